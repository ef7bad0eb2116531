; tapelayer 1.2.3
; source: panel.txt
; source sha256: abababababababababababababababababababababababababababababababab
; setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd
; controller: sinumerik840d
; units: mm, deg, s, feed in mm/min
; text sha256: dad129dfd9f3be13feef76ac629219c08cbdf906d9ade6901cc14f08c8395e9b
N10 G17 G71 G40
N20 FGROUP(X,Y,Z,A,C,U,V,Q1,B1,B2)
; course 1 of 2
N30 G90 G94
N40 M24
N50 G0 Z10.000
N60 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U=12.500 V=0.000 Q1=0.000 B1=0.000 B2=0.000
N70 G1 Z50.000 F2000.00
N80 M20
N90 M27
N100 X103.000 Y4.000 U=17.500 F848.528
N110 X106.000 Y8.000 U=22.500
N120 G4 F0.250000
N130 V=0.001 B1=-12.345 F7407.00
N140 M28
N150 M25
N160 G0 Z10.000
; course 2 of 2
N170 G90 G94
N180 G0 Z10.000
N190 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U=22.500 V=0.001 Q1=0.000 B1=-12.345 B2=0.000
N200 Z20.000
N210 G1 X3.000 Y12.000 F600.000
N220 M30
