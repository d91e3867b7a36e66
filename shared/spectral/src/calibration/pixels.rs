//! Bias, dark current and gain of every pixel, from dark and white frames.

use crate::mosaic::check_length;
use crate::{DarkReference, Mosaic, Reference, SpectralError};

/// Smallest valid `white - dark`, counts.
const MIN_SIGNAL: f64 = 1.0;

/// The white reference and its recording.
#[derive(Clone, Debug, PartialEq)]
pub struct WhitePanel {
    /// Exposure time of the white frames, ns.
    pub exposure_nanos: u64,
    /// Reflectance, above 0 and at most 1: one value for all bands, or one for each in the order of the pattern.
    pub reflectances: Vec<f64>,
    /// Left column, top row, width and height of the panel in the raw image, px. The mean signal of each band in this
    /// region is used for all pixels of the band, so the vignetting of the lens stays in the reflectance. `None`: the
    /// panel fills the image, and each pixel has its own signal.
    pub region: Option<[u32; 4]>,
}

/// Calibration of a pixel: turns its counts into reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Counts without light at zero exposure time.
    pub bias: f32,
    /// Counts per ns without light.
    pub dark_rate: f32,
    /// `rho_white t_white / (white - dark)` in ns per count; 0 = dead.
    pub gain: f32,
}

/// All pixels of the raw image, computed on access.
pub struct Pixels<'a> {
    mosaic: &'a Mosaic,
    darks: DarkLines<'a>,
    white: &'a Reference,
    panel: &'a WhitePanel,
    /// Mean signal of each band in the region of the panel, if there is one.
    band_signals: Option<Vec<Option<f64>>>,
}

impl<'a> Pixels<'a> {
    /// All references must hold frames.
    pub fn new(
        mosaic: &'a Mosaic,
        darks: &[DarkReference<'a>],
        white: &'a Reference,
        panel: &'a WhitePanel,
    ) -> Result<Self, SpectralError> {
        check(mosaic, darks, white, panel)?;
        let mut pixels = Self { mosaic, darks: DarkLines::new(darks)?, white, panel, band_signals: None };
        pixels.band_signals = panel.region.map(|region| pixels.band_means(region));
        Ok(pixels)
    }

    /// Whether a pixel may have a dark current.
    pub fn dark_grows(&self) -> bool {
        self.darks.spread > 0.0
    }

    /// The pixel at column `x`, row `y`.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> Pixel {
        self.known(x, y).unwrap_or_default()
    }

    #[inline]
    fn known(&self, x: usize, y: usize) -> Option<Pixel> {
        let at = y * self.mosaic.size()[0] as usize + x;
        let line = self.darks.at(at)?;
        let DarkLine { bias, rate } = line;
        let reflectances = &self.panel.reflectances;
        let (signal, reflectance) = match (&self.band_signals, &reflectances[..]) {
            (None, [reflectance]) => (self.signal(at, line)?, *reflectance),
            (band_signals, reflectances) => {
                let band = self.mosaic.band_of(at);
                let signal =
                    band_signals.as_ref().map_or_else(|| self.signal(at, line), |band_signals| band_signals[band]);
                (signal?, reflectances[band % reflectances.len()])
            }
        };
        let gain = reflectance * self.panel.exposure_nanos as f64 / signal;
        Some(Pixel { bias: bias as f32, dark_rate: rate as f32, gain: gain as f32 })
    }

    /// White minus dark, counts.
    fn signal(&self, at: usize, line: DarkLine) -> Option<f64> {
        let dark = line.bias + line.rate * self.panel.exposure_nanos as f64;
        Some(f64::from(self.white.mean(at)?) - dark).filter(|signal| *signal >= MIN_SIGNAL)
    }

    /// The mean signal of each band in the region; `None` if all its pixels in the region are dead.
    fn band_means(&self, [x, y, width, height]: [u32; 4]) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0_u32); self.mosaic.n_bands()];
        let pixels = (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y)));
        for (x, y) in pixels {
            let at = y as usize * self.mosaic.size()[0] as usize + x as usize;
            if let Some(signal) = self.darks.at(at).and_then(|line| self.signal(at, line)) {
                let (sum, n) = &mut sums[self.mosaic.band_of(at)];
                *sum += signal;
                *n += 1;
            }
        }
        sums.into_iter().map(|(sum, n)| (n > 0).then(|| sum / f64::from(n))).collect()
    }
}

fn check(
    mosaic: &Mosaic,
    darks: &[DarkReference<'_>],
    white: &Reference,
    panel: &WhitePanel,
) -> Result<(), SpectralError> {
    if panel.exposure_nanos == 0 {
        return Err(SpectralError::Exposure { what: "white", nanos: 0 });
    }
    let n = panel.reflectances.len();
    if n != 1 && n != mosaic.n_bands() {
        return Err(SpectralError::PanelBands { n, n_bands: mosaic.n_bands() });
    }
    if let Some(reflectance) = panel.reflectances.iter().find(|value| !(**value > 0.0 && **value <= 1.0)) {
        return Err(SpectralError::WhiteReflectance(*reflectance));
    }
    for dark in darks {
        check_length("dark", dark.frames.mosaic().n_samples(), mosaic.n_samples())?;
        dark.frames.check()?;
    }
    check_length("white", white.mosaic().n_samples(), mosaic.n_samples())?;
    white.check()?;
    let [x0, y0] = mosaic.origin().map(u64::from);
    let [width, height] = mosaic.area().map(|side| side as u64);
    match panel.region {
        Some(region) => {
            let [x, y, w, h] = region.map(u64::from);
            let sides = [w, h].into_iter().all(|side| side >= u64::from(mosaic.pattern()));
            let inside = x >= x0 && y >= y0 && x + w <= x0 + width && y + h <= y0 + height;
            let area = [x0, y0, width, height];
            if sides && inside { Ok(()) } else { Err(SpectralError::Region { region, area }) }
        }
        None => Ok(()),
    }
}

/// Bias and dark current of each pixel by linear least squares over its means at all exposure times. With one exposure time the dark
/// current is zero.
struct DarkLines<'a> {
    darks: Vec<OffsetDark<'a>>,
    /// Mean exposure time, ns.
    middle: f64,
    /// Sum of the squared deviations of the exposure times from their mean, ns^2.
    spread: f64,
}

/// A dark reference.
struct OffsetDark<'a> {
    /// Exposure time from the mean of all.
    offset_nanos: f64,
    frames: &'a Reference,
}

/// Dark signal of a pixel over the exposure time.
#[derive(Clone, Copy)]
struct DarkLine {
    /// Counts.
    bias: f64,
    /// Dark current, counts per ns.
    rate: f64,
}

impl<'a> DarkLines<'a> {
    fn new(darks: &[DarkReference<'a>]) -> Result<Self, SpectralError> {
        if darks.is_empty() {
            return Err(SpectralError::Frames { what: "dark", n_frames: 0 });
        }
        let middle = darks.iter().map(|dark| dark.exposure_nanos as f64).sum::<f64>() / darks.len() as f64;
        let with_offset = |dark: &DarkReference<'a>| OffsetDark {
            offset_nanos: dark.exposure_nanos as f64 - middle,
            frames: dark.frames,
        };
        let darks: Vec<OffsetDark<'a>> = darks.iter().map(with_offset).collect();
        let spread = darks.iter().map(|dark| dark.offset_nanos * dark.offset_nanos).sum();
        Ok(Self { darks, middle, spread })
    }

    /// The line of a pixel. `None` if a sample was saturated.
    #[inline]
    fn at(&self, at: usize) -> Option<DarkLine> {
        let mut sum = 0.0;
        let mut products = 0.0;
        for dark in &self.darks {
            let counts = f64::from(dark.frames.mean(at)?);
            sum += counts;
            products += dark.offset_nanos * counts;
        }
        let mean = sum / self.darks.len() as f64;
        if self.spread == 0.0 {
            return Some(DarkLine { bias: mean, rate: 0.0 });
        }
        let rate = products / self.spread;
        Some(DarkLine { bias: mean - rate * self.middle, rate })
    }
}
