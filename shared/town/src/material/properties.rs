//! Optical properties of a material.

use crate::material::texture::Pattern;
use crate::spectrum::Spectrum;
use raytrace::Vec3;

/// Optical properties of a material.
#[derive(Clone, Debug)]
pub struct Properties {
    /// Diffuse reflectance, 0 to 1.
    pub spectrum: Spectrum,
    /// Share of the light that is neither absorbed nor scattered, but specularly reflected or transmitted.
    pub specular_loss: f32,
    /// Strength of retroreflection, 0 (none) to 1 (sign foil).
    pub retroreflection: f32,
    /// Specular reflectance at normal incidence.
    pub gloss: f32,
    pattern: Pattern,
}

impl Properties {
    /// A rough surface with this spectrum and pattern.
    pub(super) const fn new(spectrum: Spectrum, pattern: Pattern) -> Self {
        Self { spectrum, specular_loss: 0.0, retroreflection: 0.0, gloss: 0.0, pattern }
    }
    pub(super) const fn loses(mut self, specular_loss: f32) -> Self {
        self.specular_loss = specular_loss;
        self
    }
    pub(super) const fn foil(mut self, retroreflection: f32) -> Self {
        self.retroreflection = retroreflection;
        self
    }
    pub(super) const fn gloss(mut self, gloss: f32) -> Self {
        self.gloss = gloss;
        self
    }
    /// Factor of the reflectance at a point of the surface (m, in the frame of its object), about 0.5 to 1.5.
    pub fn texture(&self, p: &Vec3, normal: &Vec3) -> f32 {
        self.pattern.factor(p, normal)
    }
}

/// Spectrum from percent values at the anchors of [`Spectrum::from_anchors`].
pub(super) fn curve(percent: [f32; 11]) -> Spectrum {
    Spectrum::from_anchors(percent.map(|p| 0.01 * p))
}

/// Spectrum like [`curve`], with the red edge of green leaves: chlorophyll absorbs up to 676 nm, then the reflectance
/// rises linearly to 750 nm (measured on all lawns and crowns of the Berlin library). The value at 700 nm is not used.
pub(super) fn plant(percent: [f32; 11]) -> Spectrum {
    let anchors = curve(percent);
    let low = anchors.at(650.0);
    let high = anchors.at(750.0);
    Spectrum::from_fn(|nm| {
        if (650.0..750.0).contains(&nm) { low + (high - low) * ((nm - 676.0) / 74.0).max(0.0) } else { anchors.at(nm) }
    })
}

/// Spectrum of a paint from percent values in red, green, blue and infrared.
pub(super) fn paint(percent: [f32; 3], infrared: f32) -> Spectrum {
    Spectrum::paint(percent.map(|p| 0.01 * p), 0.01 * infrared)
}
