; job: golden.toml
; cutter: kind "torus"
; units: mm and degrees
; X: travel along the spindle axis, 0 is the part's
; Y: attack axis, from the spindle axis to the tool centre
; A: turn of the part about X, right-handed
; F is mm/min over X, Y and A, a degree as one of the mm
; start the cutter before this program: it starts no spindle and changes no tool
N10 G71 G90 G17 G40 G94
N20 G0 Y122.0349
N30 G0 X-8.25 A0
N40 G1 Y96.9483 F1500
N50 #FGROUP [X,Y,A]
N60 G1 X-8 Y91.4366 A45 F2343.13
N70 G1 X-7.75 Y101.9114 A90 F2223.78
N80 G1 X-7.5 Y99.5689 A135 F2191
N90 G1 X-7.25 Y63.1134 A180 F1990.07
N100 G1 X-7 Y68.656 A225 F3498.78
N110 G1 X-6.75 Y58.2121 A270 F3361.32
N120 G1 X-6.5 Y60.5855 A315 F4087.47
N130 G1 X-6.25 Y97.0717 A360 F2011.93
N140 G1 X-6 Y91.5601 A405 F2343.13
N150 G1 X-5.75 Y102.0349 A450 F2223.78
N160 G1 X-5.5 Y99.6923 A495 F2191
N170 G1 X-5.25 Y63.2369 A540 F1990.07
N180 #FGROUP
N190 G0 Y122.0349
N200 M30
