//! What surfaces are made of: reflectance spectrum, pattern, and how a laser beam and a mirror image fare on it.
//!
//! The spectra are drawn by hand after the families of the USGS and ECOSTRESS libraries (asphalt rises slowly, brick
//! steps at 550 nm, leaves have the red edge at 700 nm); colors and laser intensities follow from them, so that all
//! sensors tell the same story.

use crate::noise::value_noise;
use crate::random::{hash, unit};
use crate::spectrum::Spectrum;
use crate::trace::Vec3;

/// A material by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[allow(missing_docs, reason = "the names say all that there is to say")]
pub enum Material {
    Asphalt,
    RoadPaint,
    Slab,
    Granite,
    Grass,
    PlasterCream,
    PlasterGray,
    PlasterRose,
    Limestone,
    Brick,
    Concrete,
    Zinc,
    Wood,
    Glass,
    CarGlass,
    PaintWhite,
    PaintBlack,
    PaintSilver,
    PaintRed,
    PaintBlue,
    Rubber,
    DarkMetal,
    GreenPlastic,
    Bark,
    Leaves,
    Skin,
    Denim,
    RedCloth,
    GrayCloth,
    YellowCloth,
    SignRed,
    SignBlue,
    Lamp,
}

/// The pattern on a material.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pattern {
    Plain,
    /// Grains and repaired patches.
    Grain,
    /// Rain stains over swells of a metre and more.
    Stains,
    /// Courses of blocks: width and height in m, strength of the joints (negative = darker).
    Blocks {
        width: f32,
        height: f32,
        joint: f32,
    },
    /// Light and dark leaves.
    Leafy,
}

/// All that the sensors need to know of a material.
#[derive(Clone, Debug)]
pub struct Properties {
    /// Diffuse reflectance.
    pub spectrum: Spectrum,
    /// Share of beams that are lost (mirrored away or let through).
    pub beam_loss: f32,
    /// Returned by a reflecting foil, added to the diffuse reflectance; 1 fills the upper half of the intensities.
    pub retroreflection: f32,
    /// Share of the camera's light that is the mirrored sky at normal incidence.
    pub gloss: f32,
    pattern: Pattern,
}

impl Material {
    /// All materials by their number.
    pub const ALL: [Self; 33] = [
        Self::Asphalt,
        Self::RoadPaint,
        Self::Slab,
        Self::Granite,
        Self::Grass,
        Self::PlasterCream,
        Self::PlasterGray,
        Self::PlasterRose,
        Self::Limestone,
        Self::Brick,
        Self::Concrete,
        Self::Zinc,
        Self::Wood,
        Self::Glass,
        Self::CarGlass,
        Self::PaintWhite,
        Self::PaintBlack,
        Self::PaintSilver,
        Self::PaintRed,
        Self::PaintBlue,
        Self::Rubber,
        Self::DarkMetal,
        Self::GreenPlastic,
        Self::Bark,
        Self::Leaves,
        Self::Skin,
        Self::Denim,
        Self::RedCloth,
        Self::GrayCloth,
        Self::YellowCloth,
        Self::SignRed,
        Self::SignBlue,
        Self::Lamp,
    ];

    /// Diffuse reflectance, 0 to 1.
    pub fn spectrum(self) -> Spectrum {
        let anchors = Spectrum::from_anchors;
        match self {
            Self::Asphalt => anchors([0.07, 0.08, 0.09, 0.10, 0.11, 0.12, 0.12, 0.13, 0.14, 0.15, 0.16]),
            Self::RoadPaint => anchors([0.45, 0.58, 0.64, 0.66, 0.67, 0.67, 0.67, 0.66, 0.65, 0.62, 0.60]),
            Self::Slab => anchors([0.19, 0.23, 0.26, 0.29, 0.31, 0.32, 0.33, 0.34, 0.34, 0.35, 0.36]),
            Self::Granite => anchors([0.26, 0.29, 0.31, 0.33, 0.34, 0.35, 0.36, 0.36, 0.36, 0.35, 0.34]),
            Self::Grass => anchors([0.03, 0.04, 0.05, 0.10, 0.07, 0.05, 0.12, 0.38, 0.44, 0.46, 0.45]),
            Self::PlasterCream => anchors([0.32, 0.42, 0.50, 0.57, 0.61, 0.63, 0.65, 0.66, 0.67, 0.68, 0.68]),
            Self::PlasterGray => anchors([0.36, 0.41, 0.44, 0.46, 0.47, 0.48, 0.48, 0.49, 0.50, 0.51, 0.52]),
            Self::PlasterRose => anchors([0.25, 0.30, 0.34, 0.38, 0.48, 0.53, 0.55, 0.57, 0.58, 0.60, 0.60]),
            Self::Limestone => anchors([0.34, 0.42, 0.48, 0.53, 0.57, 0.59, 0.61, 0.62, 0.63, 0.64, 0.65]),
            Self::Brick => anchors([0.06, 0.07, 0.08, 0.12, 0.24, 0.29, 0.31, 0.33, 0.33, 0.34, 0.38]),
            Self::Concrete => anchors([0.20, 0.24, 0.27, 0.29, 0.31, 0.32, 0.33, 0.34, 0.34, 0.35, 0.35]),
            Self::Zinc => anchors([0.24, 0.26, 0.27, 0.27, 0.27, 0.27, 0.27, 0.27, 0.28, 0.30, 0.36]),
            Self::Wood => anchors([0.05, 0.06, 0.08, 0.11, 0.16, 0.20, 0.25, 0.33, 0.40, 0.48, 0.50]),
            Self::Glass => anchors([0.03; 11]),
            Self::CarGlass => anchors([0.02; 11]),
            Self::PaintWhite => Spectrum::paint([0.78, 0.80, 0.78], 0.74),
            Self::PaintBlack => Spectrum::paint([0.03, 0.03, 0.03], 0.05),
            Self::PaintSilver => Spectrum::paint([0.40, 0.41, 0.42], 0.43),
            Self::PaintRed => Spectrum::paint([0.50, 0.04, 0.04], 0.62),
            Self::PaintBlue => Spectrum::paint([0.04, 0.09, 0.34], 0.30),
            Self::Rubber => anchors([0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 0.04, 0.04, 0.04, 0.05]),
            Self::DarkMetal => Spectrum::paint([0.07, 0.08, 0.08], 0.12),
            Self::GreenPlastic => Spectrum::paint([0.05, 0.26, 0.09], 0.42),
            Self::Bark => anchors([0.06, 0.07, 0.09, 0.12, 0.15, 0.18, 0.22, 0.28, 0.33, 0.40, 0.44]),
            Self::Leaves => anchors([0.03, 0.04, 0.05, 0.13, 0.08, 0.05, 0.14, 0.44, 0.50, 0.52, 0.51]),
            Self::Skin => anchors([0.15, 0.20, 0.26, 0.29, 0.43, 0.52, 0.56, 0.60, 0.61, 0.58, 0.45]),
            Self::Denim => Spectrum::paint([0.07, 0.10, 0.21], 0.50),
            Self::RedCloth => Spectrum::paint([0.46, 0.07, 0.08], 0.60),
            Self::GrayCloth => Spectrum::paint([0.16, 0.16, 0.17], 0.45),
            Self::YellowCloth => Spectrum::paint([0.68, 0.52, 0.08], 0.70),
            Self::SignRed => Spectrum::paint([0.50, 0.03, 0.04], 0.55),
            Self::SignBlue => Spectrum::paint([0.03, 0.12, 0.50], 0.40),
            Self::Lamp => anchors([0.60, 0.66, 0.70, 0.72, 0.72, 0.72, 0.72, 0.72, 0.72, 0.70, 0.70]),
        }
    }

    /// All that the sensors need to know.
    pub fn properties(self) -> Properties {
        let (beam_loss, retroreflection, gloss) = match self {
            Self::Glass => (0.88, 0.0, 0.25),
            Self::CarGlass => (0.80, 0.0, 0.30),
            Self::PaintBlack => (0.25, 0.0, 0.12),
            Self::PaintWhite | Self::PaintSilver | Self::PaintRed | Self::PaintBlue => (0.04, 0.0, 0.10),
            Self::SignRed | Self::SignBlue => (0.0, 1.0, 0.02),
            Self::RoadPaint => (0.0, 0.25, 0.0),
            _ => (0.0, 0.0, 0.0),
        };
        Properties { spectrum: self.spectrum(), beam_loss, retroreflection, gloss, pattern: self.pattern() }
    }

    const fn pattern(self) -> Pattern {
        match self {
            Self::Asphalt | Self::RoadPaint | Self::Granite | Self::Bark => Pattern::Grain,
            Self::Slab => Pattern::Blocks { width: 0.6, height: 0.6, joint: -0.35 },
            Self::Brick => Pattern::Blocks { width: 0.23, height: 0.078, joint: 0.5 },
            Self::Limestone => Pattern::Blocks { width: 0.9, height: 0.4, joint: -0.25 },
            Self::PlasterCream | Self::PlasterGray | Self::PlasterRose | Self::Concrete | Self::Zinc => Pattern::Stains,
            Self::Leaves | Self::Grass => Pattern::Leafy,
            _ => Pattern::Plain,
        }
    }
}

impl Properties {
    /// Factor on the reflectance at a point of the surface (m, in the frame of the thing it belongs to), about 0.5 to 1.5.
    pub fn texture(&self, p: &Vec3, normal: &Vec3) -> f32 {
        match self.pattern {
            Pattern::Plain => 1.0,
            Pattern::Grain => {
                1.0 + 0.12 * value_noise(1, p.x * 18.0, p.y * 18.0, p.z * 18.0)
                    + 0.16 * value_noise(2, p.x / 2.5, p.y / 2.5, p.z / 2.5)
            }
            Pattern::Stains => {
                1.0 + 0.12 * value_noise(3, p.x / 1.7, p.y / 1.7, p.z / 3.0)
                    + 0.05 * value_noise(4, p.x * 4.0, p.y * 4.0, p.z * 2.0)
            }
            Pattern::Blocks { width, height, joint } => blocks(p, normal, width, height, joint),
            Pattern::Leafy => 1.0 + 0.35 * value_noise(5, p.x * 9.0, p.y * 9.0, p.z * 9.0),
        }
    }
}

/// Every other course is shifted by half a block; joints are 8 % of a block's height.
fn blocks(p: &Vec3, normal: &Vec3, width: f32, height: f32, joint: f32) -> f32 {
    // On walls along the nearer axis and up, on the ground along the two axes. Not along the wall itself: the normal of an
    // uneven wall turns from cell to cell, and the blocks would jump with it.
    let (along, up) = if normal.z.abs() > 0.7 {
        (p.x, p.y)
    } else if normal.y.abs() > normal.x.abs() {
        (p.x, p.z)
    } else {
        (p.y, p.z)
    };
    let row = (up / height).floor();
    let column = along / width + 0.5 * (row as i64).rem_euclid(2) as f32;
    let (in_row, in_column) = (up / height - row, column - column.floor());
    let gap = 0.08;
    if in_row < gap || in_column < gap * height / width {
        return 1.0 + joint;
    }
    let block = hash(row as i64 as u64, column.floor() as i64 as u64);
    0.88 + 0.24 * unit(block)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reflectance_is_physical_and_every_texture_bounded() {
        for (number, material) in Material::ALL.into_iter().enumerate() {
            assert_eq!(material as usize, number);
            let properties = material.properties();
            for nm in (400..=1000).step_by(10) {
                assert!((0.0..=0.95).contains(&properties.spectrum.at(nm as f32)), "{material:?} at {nm} nm");
            }
            for i in 0..500 {
                let p = Vec3::new(i as f32 * 0.13, i as f32 * -0.07, i as f32 * 0.019);
                let factor = properties.texture(&p, &Vec3::y());
                assert!((0.4..=1.6).contains(&factor), "{material:?}: {factor}");
            }
        }
    }

    #[test]
    fn leaves_have_the_red_edge_and_asphalt_has_not() {
        let rise = |m: Material| m.spectrum().at(780.0) / m.spectrum().at(660.0);
        assert!(rise(Material::Leaves) > 5.0 && rise(Material::Asphalt) < 1.3);
    }
}
