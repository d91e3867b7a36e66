//! Ground of labeled sweeps of a real road (three sweeps of `SemanticKITTI`, HDL-64E).
//!
//! These sweeps are development data, not a held-out test: an earlier tolerance was chosen on them.

use crate::support::{GroundConfusion, LabeledCloud, classes_of, shipped_model};
use std::path::Path;

/// Ids of the benchmark classes: road, parking, sidewalk, other-ground, terrain.
const GROUND_IDS: [i32; 5] = [9, 10, 11, 12, 17];
/// High grass has this id and is within centimeters of the terrain.
const VEGETATION_ID: i32 = 15;
/// Unlabeled, or a class outside of the benchmark.
const NO_ID: i32 = 0;

/// The 4-byte numbers of a little-endian, C-ordered `.npy` file.
fn words(path: &Path) -> Vec<[u8; 4]> {
    let bytes = std::fs::read(path).expect("reads");
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].chunks_exact(4).map(|word| word.try_into().expect("four bytes")).collect()
}

/// A sweep labeled by benchmark ids; points with one of the `ignored` ids have no label.
fn labeled_sweep(points: &Path, ids: &Path, ignored: &[i32]) -> LabeledCloud {
    let coordinates: Vec<f32> = words(points).into_iter().map(f32::from_le_bytes).collect();
    let ids: Vec<i32> = words(ids).into_iter().map(i32::from_le_bytes).collect();
    assert_eq!(coordinates.len(), 3 * ids.len());
    let mut cloud = LabeledCloud::default();
    for (xyz, id) in coordinates.chunks_exact(3).zip(ids) {
        cloud.push([xyz[0], xyz[1], xyz[2]], (!ignored.contains(&id)).then(|| GROUND_IDS.contains(&id)));
    }
    cloud
}

/// Confusion matrix of the three sweeps.
fn pooled(ignored: &[i32]) -> GroundConfusion {
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let mut pooled = GroundConfusion::default();
    for number in 0..3 {
        let folder = real_data::path("semantickitti");
        let points = folder.join(format!("kitti_01_points_00000{number}.npy"));
        let ids = folder.join(format!("kitti_01_labels_00000{number}.npy"));
        let cloud = labeled_sweep(&points, &ids, ignored);
        let confusion = GroundConfusion::new(&cloud, &classes_of(model.as_ref(), &cloud.points));
        println!("{number}: {confusion:?} accuracy {:.4} IoU {:.4}", confusion.accuracy(), confusion.iou());
        pooled = pooled.plus(confusion);
    }
    println!("all: {pooled:?} accuracy {:.4} IoU {:.4}", pooled.accuracy(), pooled.iou());
    pooled
}

#[real_data::test("semantickitti")]
fn ground_of_real_road_is_found() {
    let confusion = pooled(&[NO_ID]);
    // Labeling all points as ground gives 0.744.
    assert!(confusion.accuracy() > 0.97, "{confusion:?}");
    assert!(confusion.recall() > 0.985, "{confusion:?}");
}

#[real_data::test("semantickitti")]
fn ground_of_real_road_without_vegetation_is_found() {
    let confusion = pooled(&[NO_ID, VEGETATION_ID]);
    // Labeling all points as ground gives 0.926.
    assert!(confusion.accuracy() > 0.98, "{confusion:?}");
}
