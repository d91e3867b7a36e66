//! Classes of the categories of nuScenes.

use messages::ClassId::{
    self, Dynamic, Ground, Other, Pedestrian, Road, Sidewalk, Static, Terrain, Unlabeled, Vegetation, Vehicles,
};

/// The class of a category. Man-made structures are unlabeled: the category combines buildings, walls, poles and signs.
pub(super) fn class_of_category(name: &str) -> Result<ClassId, String> {
    let (group, rest) = name.split_once('.').unwrap_or((name, ""));
    Ok(match (group, rest) {
        ("noise", "") | ("vehicle", "ego") | ("static", "manmade" | "other") => Unlabeled,
        ("animal", "") => Other,
        ("human", _) => Pedestrian,
        ("vehicle", _) => Vehicles,
        ("movable_object", _) => Dynamic,
        ("static_object", _) => Static,
        ("flat", "driveable_surface") => Road,
        ("flat", "sidewalk") => Sidewalk,
        ("flat", "terrain") => Terrain,
        ("flat", "other") => Ground,
        ("static", "vegetation") => Vegetation,
        _ => return Err(format!("category {name:?} is not one of nuScenes")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_categories_of_lidarseg_have_classes() {
        for (name, class) in [
            ("noise", Unlabeled),
            ("animal", Other),
            ("human.pedestrian.police_officer", Pedestrian),
            ("movable_object.trafficcone", Dynamic),
            ("static_object.bicycle_rack", Static),
            ("vehicle.emergency.police", Vehicles),
            ("vehicle.ego", Unlabeled),
            ("flat.driveable_surface", Road),
            ("flat.other", Ground),
            ("flat.sidewalk", Sidewalk),
            ("flat.terrain", Terrain),
            ("static.manmade", Unlabeled),
            ("static.other", Unlabeled),
            ("static.vegetation", Vegetation),
        ] {
            assert_eq!(class_of_category(name), Ok(class), "{name}");
        }
        assert!(class_of_category("flat.sky").is_err());
    }
}
