//! Spectra from 400 to 1000 nm: reflectances of materials, sunlight and skylight, and what a filter passes of them.

/// First wavelength, nm.
const FIRST_NM: f32 = 400.0;
/// Distance of the samples, nm. Red edge and filters are 20 nm wide and more.
const STEP_NM: f32 = 10.0;
const SAMPLES: usize = 61;

/// Values from 400 to 1000 nm in steps of 10 nm, linear between. Reflectances are 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum([f32; SAMPLES]);

/// Wavelengths of [`Spectrum::from_anchors`], nm.
pub const ANCHORS_NM: [f32; 11] = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0, 800.0, 900.0, 1000.0];

impl Spectrum {
    /// From values at [`ANCHORS_NM`].
    pub fn from_anchors(values: [f32; 11]) -> Self {
        Self::from_fn(|nm| {
            let after = ANCHORS_NM.partition_point(|&a| a <= nm).clamp(1, 10);
            let (a, b) = (ANCHORS_NM[after - 1], ANCHORS_NM[after]);
            let share = (nm - a) / (b - a);
            values[after - 1] * (1.0 - share) + values[after] * share
        })
    }
    /// A paint by what it reflects in blue, green, red and infrared.
    pub fn paint([red, green, blue]: [f32; 3], infrared: f32) -> Self {
        let edge = 0.5 * (red + infrared);
        Self::from_anchors([
            blue,
            blue,
            0.5 * (blue + green),
            green,
            0.5 * (green + red),
            red,
            red,
            edge,
            infrared,
            infrared,
            infrared,
        ])
    }
    /// Sampled from a function of the wavelength in nm.
    pub fn from_fn(value: impl Fn(f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| value(FIRST_NM + STEP_NM * i as f32)))
    }
    /// Direct sunlight at the ground: a black body of 5800 K, 1 at its strongest, without what oxygen and water vapor take
    /// (ASTM G173 at 10 nm).
    pub fn sunlight() -> Self {
        Self::from_fn(|nm| planck(nm, 5800.0) / planck(500.0, 5800.0) * air(nm))
    }
    /// Light of the clear sky: sunlight scattered by the fourth power of the frequency, on a white haze.
    pub fn skylight() -> Self {
        Self::from_fn(|nm| planck(nm, 5800.0) / planck(500.0, 5800.0) * air(nm) * (0.35 + 0.65 * (480.0 / nm).powi(4)))
    }
    /// (wavelength in nm, value), 400 to 1000 nm in steps of 10.
    pub fn samples(&self) -> impl Iterator<Item = (f32, f32)> {
        self.0.iter().enumerate().map(|(i, value)| (FIRST_NM + STEP_NM * i as f32, *value))
    }
    /// The value at a wavelength in nm; the end values outside.
    pub fn at(&self, nm: f32) -> f32 {
        let position = ((nm - FIRST_NM) / STEP_NM).clamp(0.0, (SAMPLES - 1) as f32);
        let i = (position as usize).min(SAMPLES - 2);
        let share = position - i as f32;
        self.0[i] * (1.0 - share) + self.0[i + 1] * share
    }
    /// What a filter of area 1 lets through of this reflectance under a light.
    pub fn through(&self, light: &Self, filter: &Filter) -> f32 {
        filter.0.iter().zip(self.0.iter().zip(&light.0)).map(|(weight, (value, light))| weight * value * light).sum()
    }
}

/// How much a band lets through by wavelength, as weights of the samples of a [`Spectrum`]: exact for products of spectra
/// that are linear between their samples, however narrow the band.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter([f32; SAMPLES]);

impl Filter {
    /// Of Gaussian shape and area 1.
    pub fn gauss(center_nm: f32, sigma_nm: f32) -> Self {
        let filter = Self::from_fn(|nm| {
            let off = (nm - f64::from(center_nm)) / f64::from(sigma_nm);
            (-0.5 * off * off).exp()
        });
        let area: f32 = filter.0.iter().sum();
        Self(filter.0.map(|weight| weight / area))
    }
    /// From a response by wavelength in nm, of which every nm from 400 to 1000 counts.
    pub fn from_fn(response: impl Fn(f64) -> f64) -> Self {
        let mut weights = [0.0_f64; SAMPLES];
        for step in 0..=(SAMPLES - 1) * STEP_NM as usize {
            let position = step as f64 / f64::from(STEP_NM);
            let i = (position as usize).min(SAMPLES - 2);
            let share = position - i as f64;
            let value = response(f64::from(FIRST_NM) + step as f64);
            weights[i] += value * (1.0 - share);
            weights[i + 1] += value * share;
        }
        Self(weights.map(|weight| weight as f32))
    }
}

/// Transmission of the air beside haze: middle (nm), half width (nm) and depth of its bands. Oxygen takes light at 690 and
/// 760 nm, water vapor the rest; ozone a little of the yellow.
fn air(nm: f32) -> f32 {
    let bands = [
        (600.0, 45.0, 0.05),
        (688.0, 6.0, 0.15),
        (722.0, 8.0, 0.16),
        (762.0, 5.0, 0.38),
        (820.0, 9.0, 0.14),
        (938.0, 18.0, 0.48),
    ];
    bands.iter().map(|(middle, width, depth)| 1.0 - depth * (-((nm - middle) / width).powi(2)).exp()).product()
}

/// Planck's law without its constants.
fn planck(nm: f32, kelvin: f32) -> f32 {
    const HC_OVER_K_NM: f32 = 1.438_777e7;
    let l = nm / 1000.0;
    1.0 / (l.powi(5) * ((HC_OVER_K_NM / (nm * kelvin)).exp() - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_met_and_joined_by_lines() {
        let mut values = [0.0; 11];
        for (i, v) in values.iter_mut().enumerate() {
            *v = 0.05 * i as f32;
        }
        let spectrum = Spectrum::from_anchors(values);
        for (nm, v) in ANCHORS_NM.iter().zip(values) {
            assert!((spectrum.at(*nm) - v).abs() < 1e-6);
        }
        assert!((spectrum.at(850.0) - 0.425).abs() < 1e-6);
    }

    #[test]
    fn a_filter_sees_the_neighborhood_of_its_center() {
        let flat = Spectrum::from_fn(|_| 0.4);
        let white = Spectrum::from_fn(|_| 1.0);
        assert!((flat.through(&white, &Filter::gauss(700.0, 8.0)) - 0.4).abs() < 1e-6);
        let edge = Spectrum::from_fn(|nm| if nm > 700.0 { 1.0 } else { 0.0 });
        let (below, above) = (Filter::gauss(670.0, 8.0), Filter::gauss(730.0, 8.0));
        assert!(edge.through(&white, &below) < 0.01 && edge.through(&white, &above) > 0.99);
        // Also where the filter is narrower than the steps of the spectrum.
        let rise = Spectrum::from_fn(|nm| nm / 1000.0);
        let narrow = Filter::gauss(634.0, 2.0);
        assert!((rise.through(&white, &narrow) - 0.634).abs() < 1e-4);
    }

    #[test]
    fn the_sky_is_bluer_than_the_sun() {
        let (sun, sky) = (Spectrum::sunlight(), Spectrum::skylight());
        assert!(sky.at(450.0) / sky.at(850.0) > 1.5 * sun.at(450.0) / sun.at(850.0));
    }
}
