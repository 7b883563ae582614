"""Random scenes of bodies in contact.

`sides` and `scene` are a scene as plain data, `blocks` and `discs` draw some, `drawing` one for
every seed, `posing` hands it to the package; `checks` say whether what comes back is right.
"""
