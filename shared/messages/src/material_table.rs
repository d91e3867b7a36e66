//! The materials that 36 bands from 470 to 975 nm can distinguish.

use crate::id_table::id_table;

/// Raised when an id changes its meaning.
pub const MATERIAL_TABLE_VERSION: u64 = 1;

id_table! {
    /// A material by its id.
    MaterialId {
        /// No mosaic camera saw the point, or its spectrum fits no other material.
        Unknown = 0, "unknown";
        /// Asphalt, bitumen.
        Asphalt = 1, "asphalt";
        /// Concrete, slabs.
        Concrete = 2, "concrete";
        /// Natural stone, cobble, gravel.
        Stone = 3, "stone";
        /// Brick and clay tile.
        Brick = 4, "brick";
        /// Render and paint, on walls, wood, metal and the road.
        Paint = 5, "paint";
        /// Bare metal.
        Metal = 6, "metal";
        /// Glass.
        Glass = 7, "glass";
        /// Wood without paint, bark.
        Wood = 8, "wood";
        /// Green leaves and grass.
        Vegetation = 9, "vegetation";
        /// Dry grass.
        DryVegetation = 10, "dry-vegetation";
        /// Soil, sand.
        Soil = 11, "soil";
        /// Water.
        Water = 12, "water";
        /// Fabric, plastic, rubber.
        Fabric = 13, "fabric";
    }
}

/// Name of a material id, `"unknown"` past the table.
pub fn material_name(id: u8) -> &'static str {
    MaterialId::from_id(id).unwrap_or(MaterialId::Unknown).name()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_convert_both_ways() {
        for (id, &material) in MaterialId::ALL.iter().enumerate() {
            assert_eq!(material as usize, id);
            assert_eq!(MaterialId::from_id(id as u8), Some(material));
            assert_eq!(MaterialId::from_name(material.name()), Some(material));
        }
        assert_eq!(MaterialId::from_id(14), None);
        assert_eq!(material_name(200), "unknown");
    }
}
