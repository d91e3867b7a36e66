//! Bias, dark current and gain of every pixel, from dark and white frames.

use crate::mosaic::check_length;
use crate::{Mosaic, Reference, SpectralError};

/// `white - dark` below one count is no light.
const MIN_SIGNAL: f64 = 1.0;

/// The white panel, and how it was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct WhitePanel {
    /// Exposure time of the white frames, ns.
    pub exposure_nanos: u64,
    /// Reflectance, above 0 and at most 1: one for all bands, or one for each in the pattern's order.
    pub reflectances: Vec<f64>,
    /// Left column, top row, width and height of the panel in the raw image, px. Each band's mean signal there then holds for
    /// all its pixels: what the lens shades stays in the reflectance. None: it fills the image, and each pixel has its own.
    pub region: Option<[u32; 4]>,
}

/// What turns a pixel's counts into reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Counts without light at no exposure.
    pub bias: f32,
    /// Counts per ns without light.
    pub dark_rate: f32,
    /// `rho_white t_white / (white - dark)` in ns per count; 0 = dead.
    pub gain: f32,
}

/// All pixels of the raw image. `darks`: frames with their exposure time, ns.
pub fn pixels(
    mosaic: &Mosaic,
    darks: &[(u64, &Reference)],
    white: &Reference,
    panel: &WhitePanel,
) -> Result<Vec<Pixel>, SpectralError> {
    check(mosaic, darks, white, panel)?;
    let lines = dark_lines(darks)?;
    let t_white = panel.exposure_nanos as f64;
    let signals = white.means()?.zip(&lines).map(|(white, line)| {
        let (bias, rate) = (*line)?;
        Some(f64::from(white?) - (bias + rate * t_white)).filter(|signal| *signal >= MIN_SIGNAL)
    });
    let signals: Vec<Option<f64>> = signals.collect();
    let of_bands = panel.region.map(|region| band_means(mosaic, &signals, region));
    let pixel = |at: usize| {
        let (bias, rate) = lines[at]?;
        let band = mosaic.band_of(at);
        let signal = of_bands.as_ref().map_or(signals[at], |of_bands| of_bands[band])?;
        let reflectance = panel.reflectances[band % panel.reflectances.len()];
        let gain = reflectance * t_white / signal;
        Some(Pixel { bias: bias as f32, dark_rate: rate as f32, gain: gain as f32 })
    };
    Ok((0..mosaic.n_samples()).map(|at| pixel(at).unwrap_or_default()).collect())
}

fn check(
    mosaic: &Mosaic,
    darks: &[(u64, &Reference)],
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
    for (_, dark) in darks {
        check_length("dark", dark.mosaic().n_samples(), mosaic.n_samples())?;
    }
    check_length("white", white.mosaic().n_samples(), mosaic.n_samples())?;
    let ([x0, y0], [width, height]) = (mosaic.origin().map(u64::from), mosaic.area().map(|side| side as u64));
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

/// Of each pixel bias and dark current, by the least squares of its means at all exposure times; one exposure time alone tells
/// the bias at that time, and that it does not grow. None where a frame was saturated.
fn dark_lines(darks: &[(u64, &Reference)]) -> Result<Vec<Option<(f64, f64)>>, SpectralError> {
    let means: Vec<Vec<Option<f32>>> =
        darks.iter().map(|(_, dark)| Ok(dark.means()?.collect())).collect::<Result<_, SpectralError>>()?;
    let Some(first) = means.first() else { return Err(SpectralError::Frames { what: "dark", n_frames: 0 }) };
    let n = darks.len() as f64;
    let middle = darks.iter().map(|(nanos, _)| *nanos as f64).sum::<f64>() / n;
    let offsets: Vec<f64> = darks.iter().map(|(nanos, _)| *nanos as f64 - middle).collect();
    let spread: f64 = offsets.iter().map(|offset| offset * offset).sum();
    let line = |at: usize| {
        let counts = means.iter().map(|means| means[at].map(f64::from)).collect::<Option<Vec<f64>>>()?;
        let mean = counts.iter().sum::<f64>() / n;
        if spread == 0.0 {
            return Some((mean, 0.0));
        }
        let rate = offsets.iter().zip(&counts).map(|(offset, counts)| offset * counts).sum::<f64>() / spread;
        Some((mean - rate * middle, rate))
    };
    Ok((0..first.len()).map(line).collect())
}

/// Each band's mean signal in the region; none if all its pixels there are dead.
fn band_means(mosaic: &Mosaic, signals: &[Option<f64>], [x, y, width, height]: [u32; 4]) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0_u32); mosaic.n_bands()];
    let places = (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y)));
    for (x, y) in places {
        let at = y as usize * mosaic.size()[0] as usize + x as usize;
        if let Some(signal) = signals[at] {
            let (sum, n) = &mut sums[mosaic.band_of(at)];
            *sum += signal;
            *n += 1;
        }
    }
    sums.into_iter().map(|(sum, n)| (n > 0).then(|| sum / f64::from(n))).collect()
}
