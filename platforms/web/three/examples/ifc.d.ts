import type { Object3D } from "three";
import type { IfcAPI } from "web-ifc";

/** Adds the meshes of an IFC file to a scene. `api` has been initialised. */
export function addIfc(api: IfcAPI, bytes: Uint8Array, scene: Object3D): void;
