// Meshes of an IFC file, by web-ifc, for a scene of three.js with a `VisibilityCulling`: walls and slabs hide what is
// in other rooms; glass does not.

import * as THREE from "three";

/** Copies a geometry out of the memory of web-ifc, and frees it there. */
function shapeOf(api, model, id) {
  const part = api.GetGeometry(model, id);
  const vertices = api.GetVertexArray(part.GetVertexData(), part.GetVertexDataSize());
  const indices = api.GetIndexArray(part.GetIndexData(), part.GetIndexDataSize());
  part.delete();
  const geometry = new THREE.BufferGeometry();
  const interleaved = new THREE.InterleavedBuffer(vertices, 6);
  geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(interleaved, 3, 0));
  geometry.setAttribute("normal", new THREE.InterleavedBufferAttribute(interleaved, 3, 3));
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  return geometry;
}

/** Adds the meshes of a file to `scene`. `api` is an `IfcAPI` that has been initialised, `bytes` an `Uint8Array`. */
export function addIfc(api, bytes, scene) {
  const model = api.OpenModel(bytes);
  const [materials, shapes] = [new Map(), new Map()];
  api.StreamAllMeshes(model, ({ geometries }) => {
    for (let i = 0; i < geometries.size(); i++) {
      const { color: c, flatTransformation, geometryExpressID } = geometries.get(i);
      // Chairs of one kind have one geometry.
      if (!shapes.has(geometryExpressID)) shapes.set(geometryExpressID, shapeOf(api, model, geometryExpressID));
      const geometry = shapes.get(geometryExpressID);
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
