//! Dark and white references: the mean of several frames.

use crate::limits::MAX_FRAMES;
use crate::{Mosaic, SpectralError};

/// Marks a pixel with a saturated sample. The sum of [`MAX_FRAMES`] samples is smaller.
const SATURATED: u32 = u32::MAX;

/// The sum of the frames of one reference. Sums are integers, so the order of the frames does not matter.
#[derive(Clone, Debug)]
pub struct Reference {
    what: &'static str,
    mosaic: Mosaic,
    sums: Vec<u32>,
    n_frames: u32,
}

impl Reference {
    /// A reference without frames. `what` names it in errors: dark or white.
    pub fn new(what: &'static str, mosaic: &Mosaic) -> Self {
        Self { what, mosaic: mosaic.clone(), sums: vec![0; mosaic.n_samples()], n_frames: 0 }
    }
    /// Adds a whole raw frame.
    pub fn add(&mut self, frame: &[u16]) -> Result<(), SpectralError> {
        self.mosaic.check_frame(self.what, frame)?;
        if self.n_frames == MAX_FRAMES {
            return Err(SpectralError::Frames { what: self.what, n_frames: self.n_frames + 1 });
        }
        let saturation = self.mosaic.saturation();
        for (sum, sample) in self.sums.iter_mut().zip(frame) {
            let is_saturated = *sum == SATURATED || *sample >= saturation;
            *sum = if is_saturated { SATURATED } else { *sum + u32::from(*sample) };
        }
        self.n_frames += 1;
        Ok(())
    }
    /// Number of frames added so far.
    pub fn n_frames(&self) -> u32 {
        self.n_frames
    }
    pub(crate) fn mosaic(&self) -> &Mosaic {
        &self.mosaic
    }
    /// Fails if there are no frames.
    pub(crate) fn check(&self) -> Result<(), SpectralError> {
        match self.n_frames {
            0 => Err(SpectralError::Frames { what: self.what, n_frames: 0 }),
            _ => Ok(()),
        }
    }
    /// Mean sample of pixel `at`; `None` if a sample was saturated.
    #[inline]
    pub(crate) fn mean(&self, at: usize) -> Option<f32> {
        let sum = self.sums[at];
        (sum != SATURATED).then(|| (f64::from(sum) / f64::from(self.n_frames)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mosaic() -> Mosaic {
        Mosaic::new([2, 2], 2, [0, 0, 2, 2], 10).expect("sound")
    }

    #[test]
    fn frames_are_averaged_and_a_saturated_sample_invalidates_its_pixel() {
        let mut white = Reference::new("white", &mosaic());
        white.add(&[100, 0, 500, 1023]).expect("fits");
        white.add(&[103, 0, 500, 10]).expect("fits");
        white.check().expect("has frames");
        assert_eq!([0, 1, 2, 3].map(|at| white.mean(at)), [Some(101.5), Some(0.0), Some(500.0), None]);
    }

    #[test]
    fn frames_of_another_size_and_empty_references_are_rejected() {
        let mut dark = Reference::new("dark", &mosaic());
        assert_eq!(dark.add(&[1, 2, 3]), Err(SpectralError::Length { what: "dark", got: 3, expected: 4 }));
        assert_eq!(dark.n_frames(), 0);
        assert!(matches!(dark.check(), Err(SpectralError::Frames { what: "dark", n_frames: 0 })));
    }
}
