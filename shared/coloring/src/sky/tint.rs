//! Brightness and blueness of a color.

/// Brightness and blueness.
#[derive(Clone, Copy, Debug)]
pub struct Tint {
    /// Mean of the channels, 0 to 255.
    pub level: f32,
    /// Share of blue in their sum, 0 to 1.
    pub blue: f32,
}

impl Tint {
    /// Of red, green and blue, 0 to 255.
    pub fn of(rgb: [impl Into<f32>; 3]) -> Self {
        let [r, g, b] = rgb.map(Into::into);
        let sum = r + g + b;
        Self { level: sum / 3.0, blue: b / sum.max(1.0) }
    }
}
