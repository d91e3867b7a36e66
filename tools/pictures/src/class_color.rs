//! Colors of the classes in pictures.

/// sRGB by class id: the colors of CARLA, except that unlabeled is gray instead of black.
const CLASS_COLORS: [[u8; 3]; 23] = [
    [96, 96, 100],
    [110, 110, 118],
    [190, 153, 153],
    [55, 90, 80],
    [220, 20, 60],
    [190, 190, 190],
    [157, 234, 50],
    [128, 64, 128],
    [244, 35, 232],
    [107, 142, 35],
    [40, 70, 230],
    [102, 102, 156],
    [220, 220, 0],
    [70, 130, 180],
    [110, 40, 110],
    [150, 100, 100],
    [230, 150, 140],
    [180, 165, 180],
    [250, 170, 30],
    [110, 190, 160],
    [170, 120, 50],
    [45, 60, 150],
    [145, 170, 100],
];

/// Color of a number that is not a class id.
const UNKNOWN: [u8; 3] = [90, 94, 102];

/// sRGB of a class id.
pub fn class_color(class: u8) -> [u8; 3] {
    CLASS_COLORS.get(usize::from(class)).copied().unwrap_or(UNKNOWN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_has_its_own_color() {
        assert_eq!(CLASS_COLORS.len(), messages::ClassId::ALL.len());
        for (index, color) in CLASS_COLORS.iter().enumerate() {
            assert!(!CLASS_COLORS[..index].contains(color), "class {index}");
        }
    }
}
