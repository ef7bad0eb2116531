%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: linuxcnc)
(units: mm, deg, s, feed in 1/min)
N10 G17 G21 G40 G49 G80
N20 G64 P0.01
(course 1 of 2)
N30 G90 G93
N40 M62 P5
N50 G0 Z10.000
N60 M68 E0 Q0.000
N70 X100.000 Y0.000 Z10.000 A0.000 B0.000 C-30.000 U12.500 V0.000 W0.000
N80 G1 Z50.000 F50.0000
N90 M62 P0
N100 M62 P4
N110 X103.000 Y4.000 U17.500 F120.000
N120 X106.000 Y8.000 U22.500 F120.000
N130 G4 P0.250000
N140 B-12.345 V0.001 F600.000
N150 M63 P4
N160 M63 P0
N170 G0 Z10.000
(course 2 of 2)
N180 G90 G93
N190 G0 Z10.000
N200 M68 E0 Q0.000
N210 X0.000 Y8.000 Z10.000 A0.000 B-12.345 C-30.000 U22.500 V0.001 W0.000
N220 Z20.000
N230 G1 X3.000 Y12.000 F120.000
N240 M2
%
