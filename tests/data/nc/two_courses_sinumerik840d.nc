; tapelayer 1.2.3
; source: panel.txt
; source sha256: abababababababababababababababababababababababababababababababab
; setup sha256: cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd
; controller: sinumerik840d
; units: mm, deg, s, feed in mm/min
; text sha256: 3eaa95e809f0be9a39bf7ca76486ab6ff80f339656b5fd85ad2893b21de63232
N10 G17 G71 G40
N20 FGROUP(X,Y,Z,A,C,U,V,Q1,B1,B2)
; course 1 of 2
N30 G90 G94
N40 M24
N50 G60
N60 G0 Z10.000
N70 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U=12.500 V=0.000 Q1=0.000 B1=0.000 B2=0.000
N80 G1 Z50.000 F2000.00
N90 M20
N100 M27
N110 X103.000 Y4.000 U=17.500 F848.528
N120 X106.000 Y8.000 U=22.500
N130 G4 F0.250000
N140 V=0.001 B1=-12.345 F7407.00
N150 M28
N160 M25
N170 G0 Z10.000
; course 2 of 2
N180 G90 G94
N190 G60
N200 G0 Z10.000
N210 X0.000 Y8.000 Z10.000 A0.000 C-30.000 U=22.500 V=0.001 Q1=0.000 B1=-12.345 B2=0.000
N220 Z20.000
N230 G1 X3.000 Y12.000 F600.000
N240 M30
