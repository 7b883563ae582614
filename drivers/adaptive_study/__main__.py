"""Uniform against adaptive refinement, orders 1 to 4: errors, estimates, rates, meshes, seconds."""

import ngsolve as ng

from drivers.adaptive_study.runs import main

if __name__ == "__main__":
    with ng.TaskManager():
        main()
