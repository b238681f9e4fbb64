"""One module a group of commands: what they do, in the words of the command line."""

from multipendula.commands.arguments import GROUPS

__all__ = ["GROUPS"]
