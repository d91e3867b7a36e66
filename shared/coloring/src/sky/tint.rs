//! Brightness and blueness of a color.

/// Brightness and blueness.
#[derive(Clone, Copy, Debug)]
pub struct Tint {
    /// Brightness, 0 to 255, as in [`ColorImage::brightness`](crate::ColorImage::brightness).
    pub level: f32,
    /// Share of blue in the sum of the channels, 0 to 1.
    pub blue: f32,
}

impl Tint {
    /// Computes the tint of red, green and blue, 0 to 255.
    pub fn from_rgb(rgb: [impl Into<f32>; 3]) -> Self {
        let [r, g, b] = rgb.map(Into::into);
        Self { level: (r + 2.0 * g + b) / 4.0, blue: b / (r + g + b).max(1.0) }
    }
}
