%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: jb3208)
(units: mm, deg, s, feed in mm/min)
(text sha256: e895c841c7a7e84ba2f8571f71e04790b43cc45c903888e89fd9ee34ae2d90ae)
(course 1 of 2)
N10 G90
N20 M24
N30 G61
N40 G00 Z10.000
N50 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U12.500 V0.000 Q0.000 D0.000 E0.000
N60 G01 Z50.000 F2000.00
N70 M20
N80 M27
N90 X103.000 Y4.000 U17.500 F600.000
N100 X106.000 Y8.000 U22.500
N110 G04 P0.250000
N120 V0.001 D-12.345 F7407.00
N130 M28
N140 M25
N150 G00 Z10.000
(course 2 of 2)
N160 G90
N170 G61
N180 G00 Z10.000
N190 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U22.500 V0.001 Q0.000 D-12.345 E0.000
N200 Z20.000
N210 G01 X3.000 Y12.000 F600.000
N220 M30
%
