// A plugin for 3DTilesRendererJS: tiles that stand behind others are not drawn.
//
//   tiles.registerPlugin(new VisibilityPlugin({ scene, camera }));

import { VisibilityCulling } from "visibility-three";

export class VisibilityPlugin {
  name = "VISIBILITY_PLUGIN";

  /** `scene` is the one that is drawn, with `tiles.group` in it; the others are options of `VisibilityCulling`. */
  constructor({ scene, camera, ...options }) {
    Object.assign(this, { scene, camera, options });
  }

  init(tiles) {
    // Tiles may be hidden: by default they are not `frustumCulled`, and never hidden.
    tiles.autoDisableRendererCulling = false;
    this.culling = new VisibilityCulling(this.scene, this.camera, this.options);
  }

  dispose() {
    this.culling.dispose();
  }
}
