//! Scene formats that the programs do not read, and advice how to convert each to glTF.

use std::path::Path;

/// Scene format that the programs do not read: its file name extensions, its name, and how to convert it to
/// glTF.
struct OtherFormat {
    extensions: &'static [&'static str],
    name: &'static str,
    way: &'static str,
}

const OTHER_FORMATS: &[OtherFormat] = &[
    OtherFormat {
        extensions: &["tmx", "ldtk", "ldtkl"],
        name: "a map of tiles",
        way: "the program `plan` reads it as a plan",
    },
    OtherFormat {
        extensions: &["obj"],
        name: "a Wavefront OBJ file",
        way: "`npx obj2gltf -i IN.obj -o OUT.glb` makes glTF of it, an object for each `o` of the file",
    },
    OtherFormat {
        extensions: &["ifc", "ifczip"],
        name: "an IFC building model",
        way: "`IfcConvert IN.ifc OUT.glb` of IfcOpenShell makes glTF of it, an object for each product; so do \
              `pip install ifcopenshell` and `python -c \"import ifcopenshell as i, ifcopenshell.geom as g; \
              f = i.open('IN.ifc'); s = g.settings(); o = g.serializers.gltf('OUT.glb', s); o.setFile(f); \
              o.writeHeader(); [o.write(e) for e in g.iterate(s, f)]; o.finalize()\"`",
    },
    OtherFormat {
        extensions: &["json", "jsonl", "gml"],
        name: "no scene; if it is a CityJSON city",
        way: "`pip install 'cjio[export]'`, then `cjio IN.city.json export glb OUT.glb` makes glTF of it, an \
              object for each city object (CityGML first by citygml-tools)",
    },
    OtherFormat {
        extensions: &["vox"],
        name: "a MagicaVoxel file",
        way: "export .obj in MagicaVoxel, or by `pip install vox2obj` and `python -c \"from vox2obj.vox2obj \
              import convert_to_obj as c; c('IN.vox', 'OUT.obj')\"`; then `npx obj2gltf -i OUT.obj -o OUT.glb`",
    },
    OtherFormat {
        extensions: &["bsp", "map"],
        name: "a map of a Quake or Source game",
        way: "with `cargo run --release --features maps`, .bsp files of Quake, Quake 2 and Half-Life are \
              read, and `python platforms/python/examples/quake3_level.py` draws those of Quake 3. For others, \
              open the .map in TrenchBroom and export .obj, or import the .bsp into Blender by an \
              add-on and export glTF; `npx obj2gltf -i IN.obj -o OUT.glb` makes glTF of .obj. The .prt file of \
              the map compiler is read for portals",
    },
    OtherFormat {
        extensions: &["wad", "pk3"],
        name: "a file of a Doom game",
        way: "`python platforms/python/examples/doom_map.py` draws what is seen on the plan of a map. For a \
              scene, import a map into Blender by an add-on, or export it as .obj by a map editor; `npx \
              obj2gltf -i IN.obj -o OUT.glb` makes glTF of .obj. Give each sector and wall an object of its own",
    },
    OtherFormat {
        extensions: &["stl", "ply"],
        name: "a single mesh",
        way: "`pip install trimesh`, then `python -c \"import trimesh; trimesh.load('IN.ply').export('OUT.glb')\"` \
              makes glTF of it, one object in all",
    },
    OtherFormat {
        extensions: &["blend", "fbx", "dae", "3ds", "usd", "usda", "usdc", "usdz"],
        name: "no scene that is read here",
        way: "open or import it in Blender, and export glTF 2.0 (.glb)",
    },
];

/// Returns advice for a file whose format is not read, by its extension: what the format is, and how to
/// convert it to glTF. `None` for an unknown extension.
pub(crate) fn way_to_gltf(file: &Path) -> Option<String> {
    let extension = file.extension()?.to_string_lossy().to_ascii_lowercase();
    let format = OTHER_FORMATS.iter().find(|format| format.extensions.contains(&&*extension))?;
    Some(format!("this is {}: {}", format.name, format.way))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_that_are_not_read_name_a_way_to_gltf() {
        let way = |name: &str| way_to_gltf(Path::new(name)).unwrap_or_default();
        for (name, part) in [
            ("house.OBJ", "npx obj2gltf"),
            ("a/house.ifc", "pip install ifcopenshell"),
            ("delft.city.json", "cjio IN.city.json export glb"),
            ("castle.vox", "vox2obj"),
            ("e1m1.bsp", "--features maps"),
            ("doom.wad", "doom_map.py"),
            ("cave.tmx", "program `plan`"),
            ("scan.ply", "pip install trimesh"),
            ("car.fbx", "Blender"),
        ] {
            assert!(way(name).contains(part), "{name}: {}", way(name));
        }
        assert_eq!(
            (way("scene.xyz"), way("scene"), way("scene.glb")),
            Default::default(),
            "formats that are unknown or read name no way"
        );
    }
}
