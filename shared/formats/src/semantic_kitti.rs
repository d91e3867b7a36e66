//! Classes of SemanticKITTI (Behley et al., ICCV 2019) in the class table of this project.
//!
//! The data set has two numberings: one for its label files, where moving objects have separate ids, and the ids 0 to 19
//! of its benchmark. Its label files are read by [`crate::kitti::labels_from_bytes`].

use messages::ClassId::{
    self, Building, Fence, Ground, Pedestrian, Pole, Road, RoadLine, Sidewalk, Terrain, TrafficSign, Unlabeled,
    Vegetation, Vehicles,
};

/// Classes for the ids 0 to 19 of the benchmark: unlabeled; car, bicycle, motorcycle, truck, other vehicle; person, bicyclist,
/// motorcyclist; road, parking; sidewalk; other ground; building; fence; vegetation, trunk; terrain; pole; traffic sign.
pub const CLASS_OF_BENCHMARK_ID: [ClassId; 20] = [
    Unlabeled,
    Vehicles,
    Vehicles,
    Vehicles,
    Vehicles,
    Vehicles,
    Pedestrian,
    Pedestrian,
    Pedestrian,
    Road,
    Road,
    Sidewalk,
    Ground,
    Building,
    Fence,
    Vegetation,
    Vegetation,
    Terrain,
    Pole,
    TrafficSign,
];

/// The class of an id of a label file; `None` for ids that the data set does not define. Moving objects have the class of
/// static ones. Outliers, other structures and other objects are unlabeled, as in the benchmark.
pub fn class_of_label(id: u16) -> Option<ClassId> {
    Some(match id {
        // Unlabeled, outlier, other structure, other object.
        0 | 1 | 52 | 99 => Unlabeled,
        // Car, bicycle, bus, motorcycle, on rails, truck, other vehicle; moving: car, on rails, bus, truck, other vehicle.
        10 | 11 | 13 | 15 | 16 | 18 | 20 | 252 | 256..=259 => Vehicles,
        // Person, bicyclist, motorcyclist; moving: bicyclist, person, motorcyclist.
        30..=32 | 253..=255 => Pedestrian,
        // Road, parking.
        40 | 44 => Road,
        48 => Sidewalk,
        49 => Ground,
        50 => Building,
        51 => Fence,
        60 => RoadLine,
        // Vegetation, trunk.
        70 | 71 => Vegetation,
        72 => Terrain,
        80 => Pole,
        81 => TrafficSign,
        _ => return None,
    })
}

/// The map of the data set's `semantic-kitti.yaml` (`learning_map`) from ids of label files to ids of the benchmark.
#[rustfmt::skip]
const LEARNING_MAP: [(u16, u8); 34] = [
    (0, 0), (1, 0), (10, 1), (11, 2), (13, 5), (15, 3), (16, 5), (18, 4), (20, 5), (30, 6), (31, 7), (32, 8),
    (40, 9), (44, 10), (48, 11), (49, 12), (50, 13), (51, 14), (52, 0), (60, 9), (70, 15), (71, 16),
    (72, 17), (80, 18), (81, 19), (99, 0), (252, 1), (253, 7), (254, 6), (255, 8), (256, 5), (257, 5),
    (258, 4), (259, 5),
];

/// The benchmark's id, 0 to 19, for an id of a label file; `None` for ids that the data set does not define.
pub fn benchmark_id_of_label(id: u16) -> Option<u8> {
    LEARNING_MAP.iter().find(|(label, _)| *label == id).map(|(_, benchmark_id)| *benchmark_id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_numberings_give_the_same_classes_except_lane_markings() {
        for (id, benchmark_id) in LEARNING_MAP {
            let class = class_of_label(id).expect("is defined");
            let merged = if class == RoadLine { Road } else { class };
            assert_eq!(merged, CLASS_OF_BENCHMARK_ID[usize::from(benchmark_id)], "id {id}");
            assert_eq!(benchmark_id_of_label(id), Some(benchmark_id));
        }
        let defined = (0..=u16::MAX).filter(|id| class_of_label(*id).is_some()).count();
        assert_eq!(defined, LEARNING_MAP.len());
        assert_eq!((benchmark_id_of_label(60), benchmark_id_of_label(2)), (Some(9), None));
    }
}
