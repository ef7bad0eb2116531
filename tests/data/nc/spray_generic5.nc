%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: generic5)
(units: mm, deg, s, feed in mm/min)
(text sha256: e2df88260eea3ed6d3f61630844400ddf630edf57e4f2720f7fbc0747b3e27ee)
(course 1 of 1)
N10 G90 G94
N20 G00 Z10.000
N30 X1.000 Y2.000 Z10.000 A15.000 C270.000
N40 M08
N50 G04 P0.500000
N60 M03
N70 G01 X151.000 A14.000 C271.500 F18000.0
N80 A10.000 C301.500 F3600.00
N90 M05
N100 M09
N110 G04 P0.500000
N120 M30
%
