%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: linuxcnc_remap)
(units: mm, deg, s, feed in 1/min)
(text sha256: 94ec9da87fadfccbfec86dbd57982420e34978b6db7d4ed8ef7572b4ba5bd7d5)
N10 G17 G21 G40 G49 G61 G80
(course 1 of 2)
N20 G90 G93
N30 M24
N40 G61
N50 G0 Z10.000
N60 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U12.500 V0.000 Q0.000 D0.000 E0.000 M29
N70 G1 Z50.000 F50.0000
N80 M20
N90 M27
N100 X103.000 Y4.000 U17.500 F120.000
N110 X106.000 Y8.000 U22.500 F120.000
N120 G4 P0.250000
N130 V0.001 D-12.345 F600.000 M29
N140 M28
N150 M25
N160 G0 Z10.000
(course 2 of 2)
N170 G90 G93
N180 G61
N190 G0 Z10.000
N200 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U22.500 V0.001 Q0.000 D-12.345 E0.000 M29
N210 Z20.000
N220 G1 X3.000 Y12.000 F120.000
N230 M2
%
