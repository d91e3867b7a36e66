//! Ground meshes as 3D Tiles 1.1 (OGC 22-025r4).

use geometry::LocalFrame;
use serde_json::{Value, json};

/// A mesh of a tileset.
#[derive(Clone, Debug, PartialEq)]
pub struct TileMesh {
    /// Path of the GLB relative to the tileset.
    pub file: String,
    /// Smallest and largest coordinates in the frame of the clouds, m.
    pub bounds: [[f64; 3]; 2],
}

/// Geometric error of a tileset that shows nothing, m: larger than any scene.
const ERROR_WITHOUT_MESHES_M: f64 = 1e4;

/// The document. With the place of the frame of the clouds, the tileset stands on the Earth.
pub fn tileset(meshes: &[TileMesh], frame: Option<&LocalFrame>) -> Value {
    let child = |mesh: &TileMesh| json!({"boundingVolume": {"box": bounding_box(mesh.bounds)}, "geometricError": 0.0, "content": {"uri": mesh.file}});
    let bound = |start: f64, corner: usize, choose: fn(f64, f64) -> f64| {
        meshes.iter().fold([start; 3], |bound, mesh| std::array::from_fn(|k| choose(bound[k], mesh.bounds[corner][k])))
    };
    let all = [bound(f64::INFINITY, 0, f64::min), bound(f64::NEG_INFINITY, 1, f64::max)];
    let mut root = json!({
        "boundingVolume": {"box": bounding_box(all)},
        "geometricError": ERROR_WITHOUT_MESHES_M,
        "refine": "ADD",
        "children": meshes.iter().map(child).collect::<Vec<_>>(),
    });
    if let Some(frame) = frame {
        root["transform"] = json!(frame.ecef_from_world().to_homogeneous().as_slice());
    }
    json!({"asset": {"version": "1.1", "generator": "REPLICA"}, "geometricError": ERROR_WITHOUT_MESHES_M, "root": root})
}

/// Center and half axes.
fn bounding_box([low, high]: [[f64; 3]; 2]) -> [f64; 12] {
    let center: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
    // A flat box has no volume, which viewers refuse.
    let [x, y, z] = std::array::from_fn(|axis| (0.5 * (high[axis] - low[axis])).max(0.01));
    [center[0], center[1], center[2], x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Geodetic;

    #[test]
    fn root_covers_all_meshes_and_stands_on_the_earth() {
        let mesh = |x: f64| TileMesh { file: format!("{x}.glb"), bounds: [[x, 0.0, 1.0], [x + 50.0, 50.0, 1.0]] };
        let origin = Geodetic::new(0.0, 90.0, 10.0).expect("valid");
        let document = tileset(&[mesh(-50.0), mesh(0.0)], Some(&LocalFrame::new(origin)));
        let root = &document["root"];
        assert_eq!(
            root["boundingVolume"]["box"],
            json!([0.0, 25.0, 1.0, 50.0, 0.0, 0.0, 0.0, 25.0, 0.0, 0.0, 0.0, 0.01])
        );
        assert_eq!(root["children"][1]["content"]["uri"], "0.glb");
        let matrix: Vec<f64> = serde_json::from_value(root["transform"].clone()).expect("numbers");
        // At 90 degrees east on the equator, east is -x, north is z, and up is y.
        for (found, expected) in matrix.iter().zip([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{matrix:?}");
        }
        assert!((matrix[13] - 6_378_147.0).abs() < 1e-6, "{matrix:?}");
        assert!(tileset(&[mesh(0.0)], None)["root"].get("transform").is_none());
    }
}
