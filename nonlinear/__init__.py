"""Nonlinear simulation of the scenes of `modal`; empty in this release."""
