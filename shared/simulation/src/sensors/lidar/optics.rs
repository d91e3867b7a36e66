//! Beam and receiver of the lidar models.

/// Beam and receiver of a lidar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Minimum and maximum range, m. The rig and the roof are below the minimum range.
    pub range_m: [f32; 2],
    /// Standard deviation of a range, m.
    pub range_sigma_m: f32,
    /// Width and height of the beam as full angles, rad.
    pub divergence: [f32; 2],
    /// Width and height of the beam where it leaves the device, m.
    pub aperture_m: [f32; 2],
    /// Wavelength, nm.
    pub wavelength_nm: f32,
    /// Echoes closer than this merge, m.
    pub echo_m: f32,
    /// Detection range of a surface with 10 % reflectance at normal incidence, m.
    pub tenth_m: f32,
}

impl Optics {
    /// The HDL-32E. Data sheet 97-0038: 1 to 100 m, ±2 cm (one sigma), 903 nm. Walls of stone and plaster return from
    /// farther away; in real recordings the last thousandth is between 100 and 128 m. Beam: 3.0 by 1.5 mrad and 12.7 by
    /// 9.5 mm, which the manufacturer states for the later models with the same optics (manuals of VLP-16 and VLS-128,
    /// appendix "Laser Pulse"). Echoes: two surfaces a metre apart are resolved (the same manuals); a pulse of 5 ns is
    /// 0.75 m long there and back. The range limit is fitted to a real recording: road under 20 degrees of incidence is
    /// lost between 30 and 40 m.
    pub const HDL32E: Self = Self {
        range_m: [1.0, 120.0],
        range_sigma_m: 0.02,
        divergence: [3.0e-3, 1.5e-3],
        aperture_m: [0.0127, 0.0095],
        wavelength_nm: 903.0,
        echo_m: 0.75,
        tenth_m: 90.0,
    };
    /// The VLP-16: to 100 m, ±3 cm, 903 nm, beam as above (manual 63-9243).
    pub const VLP16: Self = Self { range_m: [0.5, 120.0], range_sigma_m: 0.03, tenth_m: 80.0, ..Self::HDL32E };
    /// The VLP-32C: ±3 cm, 903 nm, beam as above (manual 63-9325). Its range is 200 m; here, ranges have 16 bits in units
    /// of 2 mm until they are sent.
    pub const VLP32C: Self = Self { range_m: [1.0, 130.0], range_sigma_m: 0.03, tenth_m: 120.0, ..Self::HDL32E };
    /// The HDL-64E: to 120 m, below 2 cm, 905 nm, 2 mrad (manual 63-HDL64ES3), stronger lasers.
    pub const HDL64E: Self = Self {
        range_m: [0.9, 120.0],
        divergence: [2.0e-3, 2.0e-3],
        wavelength_nm: 905.0,
        tenth_m: 120.0,
        ..Self::HDL32E
    };
}
