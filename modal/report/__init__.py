"""What leaves the program: tables, numbers in running text, escaped text, sealed files.

In: titles, columns, rows and bytes.  Out: text, Markdown, LaTeX, CSV, HTML or JSON in which nothing from a scene is
taken for markup or code, and files that tell whether they are damaged.  This room knows nothing of pendula. Start with
`escaping`.
"""
