"""`python -m studies.concealed`: does `softnn diagnose` name the physics left out?"""
