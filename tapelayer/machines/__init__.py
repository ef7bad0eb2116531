"""The machines: their models, and the closed forms of their inverse kinematics."""
