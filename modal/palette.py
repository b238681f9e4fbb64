"""The colours of every figure: those of Okabe and Ito, which colour-blind readers tell apart, and greys."""

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9")
STYLES = ("-", "--", ":")
INK, GRID, MARK, REST = "#22303c", "#e3e7ea", "#8a949c", "#c3cad0"
