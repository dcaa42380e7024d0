"""glTF 2.0: .glb and .gltf, VRM avatars and VRM animations; plain JSON and numpy, no library."""
