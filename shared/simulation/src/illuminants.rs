//! Spectra of sunlight and skylight.

use town::Spectrum;

/// Direct sunlight at the ground: a black body of 5800 K with maximum 1, attenuated by the absorption bands of oxygen and
/// water vapor (ASTM G173 at 10 nm).
pub fn sunlight() -> Spectrum {
    Spectrum::from_fn(|nm| planck(nm, 5800.0) / planck(500.0, 5800.0) * air(nm))
}

/// Light of the clear sky: sunlight scattered by the fourth power of the frequency, on a white haze.
pub fn skylight() -> Spectrum {
    Spectrum::from_fn(|nm| planck(nm, 5800.0) / planck(500.0, 5800.0) * air(nm) * (0.35 + 0.65 * (480.0 / nm).powi(4)))
}

/// Transmission of air without haze: middle (nm), half width (nm) and depth of its bands. Oxygen absorbs light at 690 and
/// 760 nm, ozone a little yellow light, water vapor the rest.
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
    fn skylight_is_bluer_than_sunlight() {
        let sun = sunlight();
        let sky = skylight();
        assert!(sky.at(450.0) / sky.at(850.0) > 1.5 * sun.at(450.0) / sun.at(850.0));
    }
}
