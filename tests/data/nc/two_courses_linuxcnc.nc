%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: linuxcnc)
(units: mm, deg, s, feed in 1/min)
N10 G17 G21 G40 G49 G61 G80
(course 1 of 2)
N20 G90 G93
N30 M62 P5
N40 G0 Z10.000
N50 M68 E0 Q0.000
N60 X100.000 Y0.000 Z10.000 A0.000 B0.000 C-30.000 U12.500 V0.000 W0.000
N70 G1 Z50.000 F50.0000
N80 M62 P0
N90 M62 P4
N100 X103.000 Y4.000 U17.500 F120.000
N110 X106.000 Y8.000 U22.500 F120.000
N120 G4 P0.250000
N130 B-12.345 V0.001 F600.000
N140 M63 P4
N150 M63 P0
N160 G0 Z10.000
(course 2 of 2)
N170 G90 G93
N180 G0 Z10.000
N190 M68 E0 Q0.000
N200 X0.000 Y8.000 Z10.000 A0.000 B-12.345 C-30.000 U22.500 V0.001 W0.000
N210 Z20.000
N220 G1 X3.000 Y12.000 F120.000
N230 M2
%
