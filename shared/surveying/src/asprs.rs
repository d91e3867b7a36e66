//! Classes of the ASPRS for LAS (LAS 1.4 R15, table 17).

use messages::{ClassId, GROUND_CLASSES};

/// Class of points that were never classified.
pub(crate) const NEVER_CLASSIFIED: u8 = 0;
/// Ground.
const GROUND: u8 = 2;
/// First user-defined number. Classes without an ASPRS number get this plus their id.
const FIRST_OF_USER: u8 = 64;

/// Number of the ASPRS, or the user-defined number 64 + id for classes that the ASPRS does not define.
pub fn asprs_class(class: ClassId) -> u8 {
    match class {
        ClassId::Unlabeled | ClassId::Other => 1,
        ClassId::Sidewalk | ClassId::Ground | ClassId::Terrain => GROUND,
        ClassId::Vegetation => 5,
        ClassId::Building => 6,
        ClassId::Water => 9,
        ClassId::RailTrack => 10,
        ClassId::Road | ClassId::RoadLine => 11,
        ClassId::Bridge => 17,
        ClassId::Sky => 18,
        ClassId::Fence
        | ClassId::Pedestrian
        | ClassId::Pole
        | ClassId::Vehicles
        | ClassId::Wall
        | ClassId::TrafficSign
        | ClassId::GuardRail
        | ClassId::TrafficLight
        | ClassId::Static
        | ClassId::Dynamic => FIRST_OF_USER + class as u8,
    }
}

/// The numbers of all class ids. Unknown ids are unclassified.
pub(crate) fn asprs_table() -> [u8; 256] {
    std::array::from_fn(|id| asprs_class(ClassId::from_id(id as u8).unwrap_or(ClassId::Unlabeled)))
}

/// The numbers of all class ids, where all kinds of ground have the number of ground: digital terrain models take no other number.
pub(crate) fn ground_as_2_table() -> [u8; 256] {
    let mut table = asprs_table();
    for class in GROUND_CLASSES {
        table[usize::from(class as u8)] = GROUND;
    }
    table
}

/// Names of the user-defined numbers: number and name of up to 15 characters.
pub(crate) fn user_classes() -> impl Iterator<Item = (u8, &'static str)> {
    let all = ClassId::ALL.iter().map(|class| (asprs_class(*class), class.name()));
    all.filter(|(number, _)| *number >= FIRST_OF_USER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_is_that_of_the_documentation() {
        let page = include_str!("../../../docs/reference/deliverables.md");
        for class in ClassId::ALL {
            let row = format!("| {} | {} | {} |", *class as u8, class.name(), asprs_class(*class));
            assert!(page.contains(&row), "{row}");
        }
    }

    #[test]
    fn all_kinds_of_ground_become_ground_and_others_stay() {
        let [usual, changed] = [asprs_table(), ground_as_2_table()];
        let differ: Vec<usize> = (0..256).filter(|id| usual[*id] != changed[*id]).collect();
        // Road-line, road and rail-track.
        assert_eq!(differ, [6, 7, 16]);
        assert!(GROUND_CLASSES.iter().all(|class| changed[usize::from(*class as u8)] == 2));
    }

    #[test]
    fn user_classes_keep_their_ids() {
        let mut numbers: Vec<u8> = user_classes().map(|(number, _)| number - FIRST_OF_USER).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [2, 4, 5, 10, 11, 12, 17, 18, 19, 20]);
        assert!(user_classes().all(|(_, name)| name.len() <= 15));
        assert_eq!(asprs_table()[200], 1);
    }
}
