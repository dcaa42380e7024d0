"""Runs in a Python that has pybvh: write the positions of all joints of a BVH file to an .npz.

usage: python bvh_peer.py FILE.bvh OUT.npz
"""

import sys

import numpy as np
import pybvh

if __name__ == "__main__":
    np.savez(sys.argv[2], positions=pybvh.read_bvh_file(sys.argv[1]).node_positions())
