// Meshes of an IFC file, by web-ifc, for a scene of three.js with a `VisibilityCulling`: walls and slabs hide what is
// in other rooms; glass does not.

import * as THREE from "three";

/** Adds the meshes of a file to `scene`. `api` is an `IfcAPI` that has been initialised, `bytes` an `Uint8Array`. */
export function addIfc(api, bytes, scene) {
  const model = api.OpenModel(bytes);
  const materials = new Map();
  api.StreamAllMeshes(model, ({ geometries }) => {
    for (let i = 0; i < geometries.size(); i++) {
      const { color: c, flatTransformation, geometryExpressID } = geometries.get(i);
      const part = api.GetGeometry(model, geometryExpressID);
      const vertices = api.GetVertexArray(part.GetVertexData(), part.GetVertexDataSize());
      const geometry = new THREE.BufferGeometry();
      const interleaved = new THREE.InterleavedBuffer(vertices, 6);
      geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(interleaved, 3, 0));
      geometry.setAttribute("normal", new THREE.InterleavedBufferAttribute(interleaved, 3, 3));
      geometry.setIndex([...api.GetIndexArray(part.GetIndexData(), part.GetIndexDataSize())]);
      const key = `${c.x} ${c.y} ${c.z} ${c.w}`;
      if (!materials.has(key)) {
        const glass = { transparent: c.w < 1, opacity: c.w };
        const color = new THREE.Color(c.x, c.y, c.z);
        materials.set(key, new THREE.MeshLambertMaterial({ color, side: THREE.DoubleSide, ...glass }));
      }
      const mesh = new THREE.Mesh(geometry, materials.get(key));
      mesh.applyMatrix4(new THREE.Matrix4().fromArray(flatTransformation));
      scene.add(mesh);
    }
  });
  api.CloseModel(model);
}
