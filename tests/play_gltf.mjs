// Validates a .glb by Khronos's validator, and plays it in three.js.
// node play_gltf.mjs NODE_MODULES FILE CLIP SECONDS...: one line of JSON, with the places of all
// vertices at each time, in the scene's axes.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [modules, file, clip, ...times] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(join(modules, name)));
globalThis.self = globalThis; // three.js asks a browser for it
const validator = (await load("gltf-validator/index.js")).default;
const { AnimationMixer, Vector3 } = await load("three/build/three.module.js");
const { GLTFLoader } = await load("three/examples/jsm/loaders/GLTFLoader.js");

const bytes = new Uint8Array(readFileSync(file));
const { issues, info } = await validator.validateBytes(bytes);
const { scene, animations, asset } = await new GLTFLoader().parseAsync(bytes.buffer, "");
const mixer = new AnimationMixer(scene);
if (animations.length) mixer.clipAction(animations[Number(clip)]).play();
const meshes = [];
scene.updateMatrixWorld(true);
scene.traverse((object) => object.isMesh && meshes.push(object));
const played = times.map((time) => {
  mixer.setTime(Number(time));
  return meshes.flatMap((mesh) =>
    Array.from({ length: mesh.geometry.attributes.position.count }, (_, number) =>
      mesh.getVertexPosition(number, new Vector3()).applyMatrix4(mesh.matrixWorld).toArray()));
});
const materials = meshes.map(({ material }) => [material.name, material.color.getHexString()]);
const names = animations.map(({ name }) => name);
console.log(JSON.stringify({ issues, info, materials, names, extras: asset.extras, played }));
