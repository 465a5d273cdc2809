"""Controllers that speak GCS, the command set of Physik Instrumente: a client, and a virtual one.

Source: General Command Set 2.0 as the manuals of digital piezo controllers have it, E-727 user
manual E727T0005 (2019). Positions are in um there, and metres outside this package.
"""
