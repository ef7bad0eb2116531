%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: generic5)
(units: mm, deg, s, feed in mm/min)
(text sha256: b43b763ab65231e5173f644e26f8cb13e43872c40c9de95da7063ec3dd819358)
(course 1 of 1)
N10 G90 G94
N20 G61
N30 G00 Z10.000
N40 X1.000 Y2.000 Z10.000 A15.000 C270.000
N50 M08
N60 G04 P0.500000
N70 M03
N80 G01 X151.000 A14.000 C271.500 F18000.0
N90 A10.000 C301.500 F3600.00
N100 M05
N110 M09
N120 G04 P0.500000
N130 M30
%
