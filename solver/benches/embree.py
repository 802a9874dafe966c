"""Embree on the rays of `cargo run --release --example counters -- PYTHON`, which calls this for each model.

Once: `python3 -m venv DIR && DIR/bin/pip install embreex numpy`; PYTHON is then DIR/bin/python.
By hand: `python embree.py RAYS_FILE` (made by that example; little-endian: triangles and rays as u32, the corners and
then origins and directions as f32, our answers as bytes). Prints the number of rays, the CPU seconds of one thread for
a pass over them (the best of several), and how many answers agree. Robust mode: watertight, as ours.
"""

import sys
import time

import numpy
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

PASSES = 5


def main():
    data = open(sys.argv[1], "rb").read()
    triangles, rays = numpy.frombuffer(data, "<u4", 2)
    corners = numpy.frombuffer(data, "<f4", 9 * triangles, 8).reshape(-1, 3, 3)
    start = 8 + corners.nbytes
    both = numpy.frombuffer(data, "<f4", 6 * rays, start).reshape(-1, 2, 3)
    ours = numpy.frombuffer(data, "u1", rays, start + both.nbytes) != 0
    origins, directions = (numpy.ascontiguousarray(both[:, k]) for k in range(2))
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, corners)
    # The first pass builds the BVH.
    blocked = scene.run(origins, directions, query="OCCLUDED") >= 0
    seconds = []
    for _ in range(PASSES):
        begin = time.thread_time()
        scene.run(origins, directions, query="OCCLUDED")
        seconds.append(time.thread_time() - begin)
    print(rays, min(seconds), int((blocked == ours).sum()))


main()
