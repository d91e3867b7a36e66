//! Colors of the materials in pictures.

use messages::MaterialId;

/// sRGB by material id; unknown is dark gray.
const MATERIAL_COLORS: [[u8; 3]; MaterialId::ALL.len()] = [
    [70, 72, 78],
    [105, 110, 130],
    [190, 190, 185],
    [150, 130, 105],
    [190, 80, 55],
    [240, 220, 150],
    [90, 190, 230],
    [40, 70, 200],
    [125, 75, 30],
    [60, 170, 60],
    [200, 190, 60],
    [225, 150, 70],
    [20, 110, 160],
    [220, 70, 190],
];

/// sRGB of a material id.
pub fn material_color(material: u8) -> [u8; 3] {
    MATERIAL_COLORS.get(usize::from(material)).copied().unwrap_or(MATERIAL_COLORS[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_material_has_its_own_color() {
        for (index, color) in MATERIAL_COLORS.iter().enumerate() {
            assert!(!MATERIAL_COLORS[..index].contains(color), "material {index}");
        }
    }
}
