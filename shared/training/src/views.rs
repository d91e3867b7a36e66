//! The images of a batch that go through the network, and the pixels that the loss depends on.

use crate::Example;
use crate::criterion::Criterion;
use crate::pixels::Pixels;
use kernels::images::Planes;
use random::Random;

/// Images of a batch with the pixels of the loss.
pub(crate) struct Views<'a> {
    /// The inputs of the examples, then their sparse views.
    pub(crate) images: Vec<&'a Planes>,
    pub(crate) pixels: Pixels,
    /// Labeled pixels, then pixels of sparse views, then the pixels of the full examples with the same points.
    pub(crate) used: Vec<u32>,
    /// Classes of the labeled pixels.
    pub(crate) classes: Vec<u8>,
    /// The loss has derivatives with respect to the logits of this number of used pixels. The full views of the
    /// consistency term are constants.
    pub(crate) n_derived: usize,
}

impl<'a> Views<'a> {
    /// Views of a batch; `None` if nothing is labeled.
    pub(crate) fn from_batch(
        batch: &'a [Example],
        fold: usize,
        criterion: &Criterion,
        random: &mut Random,
    ) -> Option<Self> {
        let truth = truth(batch);
        let mut used = criterion.known_rows(&truth, random);
        if used.is_empty() {
            return None;
        }
        let classes: Vec<u8> = used.iter().map(|&pixel| truth[pixel as usize]).collect();
        let mut images = inputs(batch);
        let sparse = || {
            let of_example = |(at, example): (usize, &'a Example)| Some((at, example.sparse_view.as_ref()?));
            batch.iter().enumerate().filter_map(of_example).filter(|_| criterion.consistency > 0.0)
        };
        images.extend(sparse().map(|(_, view)| &view.input));
        let pixels = Pixels::from_images(&images, criterion.n_classes, fold);
        let pairs = sparse().enumerate().flat_map(|(n, (at, view))| {
            let [of_view, of_example] = [batch.len() + n, at].map(|image| pixels.first_of(image) as u32);
            view.pixels.iter().map(move |[sparse, full]| [of_view + sparse, of_example + full])
        });
        let pairs = criterion.some_of(pairs.collect(), random);
        used.extend(pairs.iter().map(|[sparse, _]| sparse));
        let n_derived = used.len();
        used.extend(pairs.iter().map(|[_, full]| full));
        Some(Self { images, pixels, used, classes, n_derived })
    }
}

/// Inputs of a batch.
pub(crate) fn inputs(batch: &[Example]) -> Vec<&Planes> {
    batch.iter().map(|example| &example.input).collect()
}

/// Classes of all pixels of a batch.
pub(crate) fn truth(batch: &[Example]) -> Vec<u8> {
    batch.iter().flat_map(|example| example.truth.iter().copied()).collect()
}
