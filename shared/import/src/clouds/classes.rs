//! Maps the classes of labeled data sets to the classes of this project. `None`: the data set does not define the id.
//!
//! Classes without a counterpart are [`Unlabeled`]: they are not scored.

use super::Layout;
use messages::ClassId::{
    self, Building, Dynamic, Fence, Ground, GuardRail, Other, Pedestrian, Pole, Road, RoadLine, Sidewalk, Static,
    Terrain, TrafficLight, TrafficSign, Unlabeled, Vegetation, Vehicles, Wall,
};

/// The class of an id.
pub(super) fn class_of(layout: Layout, id: i64) -> Option<ClassId> {
    let found = match layout {
        // It uses the classes of this project.
        Layout::ParisCarla => return ClassId::from_id(u8::try_from(id).ok()?),
        Layout::ParisLille if id >= 100_000_000 => return paris_lille(id),
        Layout::ParisLille => PARIS_LILLE_10.get(usize::try_from(id).ok()?),
        Layout::Toronto => TORONTO.get(usize::try_from(id).ok()?),
        Layout::Street3d => STREET3D.get(usize::try_from(id).ok()?),
        Layout::Oakland => return oakland(id),
    };
    found.copied()
}

/// The ten classes of the benchmark of Paris-Lille-3D: unclassified, ground, building, pole with its sign and light, bollard,
/// trash can, barrier, pedestrian, car, natural.
const PARIS_LILLE_10: [ClassId; 10] =
    [Unlabeled, Ground, Building, Pole, Pole, Dynamic, Fence, Pedestrian, Vehicles, Vegetation];

/// Toronto-3D: unclassified, road, road marking, natural, building, utility line, pole, car, fence.
const TORONTO: [ClassId; 9] = [Unlabeled, Road, RoadLine, Vegetation, Building, Unlabeled, Pole, Vehicles, Fence];

/// `Street3D`: undefined, building, car, ground, pole, vegetation.
const STREET3D: [ClassId; 6] = [Unlabeled, Building, Vehicles, Ground, Pole, Vegetation];

/// Oakland 3-D (Munoz et al., CVPR 2009): its `labels.txt`. Kinds of ground without a surface (`ground`, `load_bearing`), wires and
/// what is not named have no counterpart.
fn oakland(id: i64) -> Option<ClassId> {
    Some(match id {
        // To label, undetermined, linear, surface and scatter of no kind, artifact; wires; load bearing, cliff, ground;
        // chimney, ceiling; rock.
        1000..=1005 | 1100..=1102 | 1105 | 1200..=1202 | 1405 | 1410 | 1600 => Unlabeled,
        // Utility pole, crossarm; support pole, lamp support, transformer; post, pylon; lamp, support of traffic lights.
        1103 | 1104 | 1106..=1108 | 1110 | 1112 | 1114 | 1116 => Pole,
        // Fire hydrant, bench, garbage, parking meter, mailbox.
        1109 | 1113 | 1117 | 1119 | 1413 => Static,
        1111 => TrafficSign,
        // Traffic light, light of a crossing.
        1115 | 1118 => TrafficLight,
        1203 => Road,
        // Curb, walkway.
        1205 | 1206 => Sidewalk,
        1207 => GuardRail,
        // Trail, grass.
        1204 | 1301 => Terrain,
        1300 | 1302..=1306 => Vegetation,
        // Facade, stairs, door, window, roof, ledge, column.
        1400 | 1402..=1404 | 1406 | 1411 | 1412 => Building,
        1401 => Wall,
        // Chain link, fence, gate, concertina wire.
        1407..=1409 | 1601 => Fence,
        1500 => Pedestrian,
        1501 => Vehicles,
        _ => return None,
    })
}

/// The tree of classes of Paris-Lille-3D: two digits per level.
const PARIS_LILLE: [(i64, ClassId); 42] = [
    (100_000_000, Other),
    (200_000_000, Unlabeled), // surface
    (202_000_000, Ground),
    (202_020_000, Road),
    (202_030_000, Sidewalk),
    (202_040_000, Sidewalk), // curb
    (202_050_000, Sidewalk), // island
    (202_060_000, Terrain),  // vegetation on the ground
    (203_000_000, Building),
    (300_000_000, Unlabeled), // object
    (302_000_000, Static),
    (302_020_200, Pole),
    (302_020_300, Pole), // bollard
    (302_020_400, Pole), // floor lamp
    (302_020_500, TrafficLight),
    (302_020_600, TrafficSign),
    (302_020_700, TrafficSign), // signboard
    (302_020_900, Dynamic),     // trash can
    (302_030_000, Unlabeled),   // linear
    (302_030_200, GuardRail),   // barrier
    (302_030_300, Fence),       // railing
    (302_030_400, Fence),       // grid
    (302_030_500, Fence),       // chain
    (302_030_700, Wall),
    (302_040_000, Static),
    (303_000_000, Dynamic),
    (303_020_000, Pedestrian),
    (303_030_000, Vehicles), // two wheels
    (303_040_000, Vehicles),
    (303_050_000, Dynamic), // furniture
    (304_000_000, Vegetation),
    // "Other" of a level: no class.
    (201_000_000, Unlabeled),
    (202_010_000, Ground),
    (301_000_000, Unlabeled),
    (302_010_000, Static),
    (302_020_100, Static),
    (302_030_100, Unlabeled),
    (302_040_100, Static),
    (303_010_000, Dynamic),
    (304_010_000, Vegetation),
    (302_030_600, Unlabeled), // wire
    (304_040_000, Vegetation),
];

/// The class of the id, or of the nearest level above it.
fn paris_lille(id: i64) -> Option<ClassId> {
    let levels = [1, 100, 10_000, 1_000_000, 100_000_000];
    levels.into_iter().find_map(|level| {
        let above = id / level * level;
        PARIS_LILLE.iter().find(|(known, _)| *known == above).map(|(_, class)| *class)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn class_of_each_layout_is_that_of_its_documentation() {
        for (layout, id, class) in [
            (Layout::ParisCarla, 22, Some(Terrain)),
            (Layout::ParisCarla, 23, None),
            (Layout::ParisCarla, -1, None),
            (Layout::ParisLille, 8, Some(Vehicles)),
            (Layout::ParisLille, 10, None),
            (Layout::ParisLille, 202_020_000, Some(Road)),
            // A parked car and a parked bicycle have no entry of their own.
            (Layout::ParisLille, 303_040_204, Some(Vehicles)),
            (Layout::ParisLille, 303_030_204, Some(Vehicles)),
            (Layout::ParisLille, 304_020_000, Some(Vegetation)),
            (Layout::ParisLille, 302_020_300, Some(Pole)),
            (Layout::ParisLille, 400_000_000, None),
            (Layout::Toronto, 2, Some(RoadLine)),
            (Layout::Toronto, 5, Some(Unlabeled)),
            (Layout::Street3d, 3, Some(Ground)),
            (Layout::Street3d, 6, None),
            (Layout::Oakland, 1203, Some(Road)),
            (Layout::Oakland, 1305, Some(Vegetation)),
            (Layout::Oakland, 1200, Some(Unlabeled)),
            (Layout::Oakland, 1502, None),
        ] {
            assert_eq!(class_of(layout, id), class, "{layout:?} {id}");
        }
    }
}
