"""Random scenes of bodies in contact, and checks that share no code with the package.

`scene` is a scene as plain data, `drawing` draws one for every seed, `posing` hands it to the
package. `measures` reads a solution, `reference` knows what is right from the scene's data alone,
`judging` compares.
"""
