%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: jb3208)
(units: mm, deg, s, feed in mm/min)
(text sha256: 843bc313b24a0180c2eaf5e0eb6f78efb558bb1db5d38966464c175a402f6dd6)
(course 1 of 2)
N10 G90
N20 M24
N30 G00 Z10.000
N40 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U12.500 V0.000 Q0.000 D0.000 E0.000
N50 G01 Z50.000 F2000.00
N60 M20
N70 M27
N80 X103.000 Y4.000 U17.500 F600.000
N90 X106.000 Y8.000 U22.500
N100 G04 P0.250000
N110 V0.001 D-12.345 F7407.00
N120 M28
N130 M25
N140 G00 Z10.000
(course 2 of 2)
N150 G90
N160 G00 Z10.000
N170 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U22.500 V0.001 Q0.000 D-12.345 E0.000
N180 Z20.000
N190 G01 X3.000 Y12.000 F600.000
N200 M30
%
