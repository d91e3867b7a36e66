//! Ground on labelled sweeps of a real street (three of `SemanticKITTI`, HDL-64E). No parameter was tuned on them.

mod support;

use real_data::real_data;
use std::path::Path;
use support::{Confusion, LabelledCloud, classes_of, shipped_model};

/// Ids of the benchmark's 19 classes: road, parking, sidewalk, other-ground, terrain.
const GROUND_IDS: [i32; 5] = [9, 10, 11, 12, 17];
/// Not labelled, or a class outside of the benchmark.
const NO_ID: i32 = 0;

/// The 4-byte numbers of a little-endian, C-ordered `.npy` file.
fn words(path: &Path) -> Vec<[u8; 4]> {
    let bytes = std::fs::read(path).expect("reads");
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].chunks_exact(4).map(|word| word.try_into().expect("four bytes")).collect()
}

fn labelled_sweep(points: &Path, ids: &Path) -> LabelledCloud {
    let coordinates: Vec<f32> = words(points).into_iter().map(f32::from_le_bytes).collect();
    let ids: Vec<i32> = words(ids).into_iter().map(i32::from_le_bytes).collect();
    assert_eq!(coordinates.len(), 3 * ids.len());
    let mut cloud = LabelledCloud::default();
    for (xyz, id) in coordinates.chunks_exact(3).zip(ids) {
        cloud.push([xyz[0], xyz[1], xyz[2]], (id != NO_ID).then(|| GROUND_IDS.contains(&id)));
    }
    cloud
}

#[test]
fn ground_of_a_real_street() {
    let model = learning::load(&shipped_model()).expect("loads");
    let mut pooled = Confusion::default();
    for number in 0..3 {
        let points = real_data(&format!("semantickitti/kitti_01_points_00000{number}.npy"));
        let ids = real_data(&format!("semantickitti/kitti_01_labels_00000{number}.npy"));
        let (Some(points), Some(ids)) = (points, ids) else { return };
        let cloud = labelled_sweep(&points, &ids);
        let confusion = Confusion::of(&cloud, &classes_of(model.as_ref(), &cloud.points));
        println!("{number}: {confusion:?} accuracy {:.4} IoU {:.4}", confusion.accuracy(), confusion.iou());
        pooled = pooled.plus(confusion);
    }
    println!("pooled: {pooled:?} accuracy {:.4} IoU {:.4}", pooled.accuracy(), pooled.iou());
}
