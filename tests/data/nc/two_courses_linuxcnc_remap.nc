%
(tapelayer 1.2.3)
(source: panel.txt)
(source sha256: abababababababababababababababababababababababababababababababab)
(setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd)
(controller: linuxcnc_remap)
(units: mm, deg, s, feed in 1/min)
(text sha256: 04e52a09a9eb4cac32c9c4ef628f99d79c1c21f7d80f83c65d2fbe0504c0f851)
N10 G17 G21 G40 G49 G61 G80
(course 1 of 2)
N20 G90 G93
N30 M24
N40 G0 Z10.000
N50 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U12.500 V0.000 Q0.000 D0.000 E0.000 M29
N60 G1 Z50.000 F50.0000
N70 M20
N80 M27
N90 X103.000 Y4.000 U17.500 F120.000
N100 X106.000 Y8.000 U22.500 F120.000
N110 G4 P0.250000
N120 V0.001 D-12.345 F600.000 M29
N130 M28
N140 M25
N150 G0 Z10.000
(course 2 of 2)
N160 G90 G93
N170 G0 Z10.000
N180 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U22.500 V0.001 Q0.000 D-12.345 E0.000 M29
N190 Z20.000
N200 G1 X3.000 Y12.000 F120.000
N210 M2
%
