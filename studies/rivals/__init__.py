"""`python -m studies.rivals`: do other methods name the physics left out?"""
