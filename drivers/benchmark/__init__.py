"""Run time against error, measured beside other codes on one machine.

`scenes` are the common problems, their meshes and what is read off them, `engines` the codes that
solve them, `studies` what is measured, with tables; each imports only from those
before it.
"""
