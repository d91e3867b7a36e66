//! Dark and white references: the mean of several frames.

use crate::{Mosaic, SpectralError};

/// Frames that a sum of u16 samples in a u32 can hold without overflow.
pub(crate) const MAX_FRAMES: u32 = 65_536;

/// The sum of the frames of one reference. Integer sums: the order of the frames does not matter.
#[derive(Clone, Debug)]
pub struct Reference {
    what: &'static str,
    mosaic: Mosaic,
    sums: Vec<u32>,
    saturated: Vec<bool>,
    n_frames: u32,
}

impl Reference {
    /// No frames yet. `what` names the reference in errors: dark or white.
    pub fn new(what: &'static str, mosaic: &Mosaic) -> Self {
        let n = mosaic.n_samples();
        Self { what, mosaic: mosaic.clone(), sums: vec![0; n], saturated: vec![false; n], n_frames: 0 }
    }
    /// Adds a whole raw frame.
    pub fn add(&mut self, frame: &[u16]) -> Result<(), SpectralError> {
        self.mosaic.check_frame(self.what, frame)?;
        if self.n_frames == MAX_FRAMES {
            return Err(SpectralError::Frames { what: self.what, n_frames: self.n_frames + 1 });
        }
        let saturation = self.mosaic.saturation();
        for ((sum, saturated), sample) in self.sums.iter_mut().zip(&mut self.saturated).zip(frame) {
            *sum += u32::from(*sample);
            *saturated |= *sample >= saturation;
        }
        self.n_frames += 1;
        Ok(())
    }
    /// Frames added so far.
    pub fn n_frames(&self) -> u32 {
        self.n_frames
    }
    pub(crate) fn mosaic(&self) -> &Mosaic {
        &self.mosaic
    }
    /// Mean sample per pixel, `None` where a frame was saturated. Fails without frames.
    pub(crate) fn means(&self) -> Result<impl Iterator<Item = Option<f32>>, SpectralError> {
        if self.n_frames == 0 {
            return Err(SpectralError::Frames { what: self.what, n_frames: 0 });
        }
        let n_frames = f64::from(self.n_frames);
        let means = self.sums.iter().zip(&self.saturated);
        Ok(means.map(move |(sum, saturated)| (!saturated).then_some((f64::from(*sum) / n_frames) as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mosaic() -> Mosaic {
        Mosaic::new([2, 2], 2, [0, 0, 2, 2], 10).expect("sound")
    }

    #[test]
    fn frames_are_averaged_and_one_saturated_sample_spoils_its_pixel() {
        let mut white = Reference::new("white", &mosaic());
        white.add(&[100, 0, 500, 1023]).expect("fits");
        white.add(&[103, 0, 500, 10]).expect("fits");
        let means: Vec<_> = white.means().expect("has frames").collect();
        assert_eq!(means, [Some(101.5), Some(0.0), Some(500.0), None]);
    }

    #[test]
    fn frames_of_another_size_and_no_frames_are_refused() {
        let mut dark = Reference::new("dark", &mosaic());
        assert_eq!(dark.add(&[1, 2, 3]), Err(SpectralError::Length { what: "dark", got: 3, expected: 4 }));
        assert_eq!(dark.n_frames(), 0);
        assert!(matches!(dark.means().err(), Some(SpectralError::Frames { what: "dark", n_frames: 0 })));
    }
}
