//! Convolution: selects the kernel.

use super::filter::Filter;
use super::planes::{Feature, Planes, PlanesRef};
use super::{direct, winograd, winograd_filter};
use pulp::Arch;
use std::ops::{Deref, DerefMut};

/// Convolves images of one size whose borders are filled; writes all of `out` except its border.
///
/// # Panics
/// If the sources do not match the shape of the filter, or `out` does not have the size of the output.
pub fn convolve<S, O>(filter: &Filter, sources: &[&Planes<S>], out: &mut Planes<O>)
where
    S: Deref<Target = [Feature]>,
    O: DerefMut<Target = [Feature]>,
{
    let shape = &filter.shape;
    let sources: Vec<PlanesRef<'_>> = sources.iter().map(|source| source.view()).collect();
    let channels: Vec<usize> = sources.iter().map(Planes::channels).collect();
    assert_eq!(channels, shape.in_channels);
    let height = sources[0].height();
    let width = sources[0].width();
    assert!(sources.iter().all(|source| (source.height(), source.width()) == (height, width)));
    assert_eq!(width % shape.stride_x, 0, "a stride must divide the width");
    let expected = (shape.out_channels, height, shape.out_width(width));
    assert_eq!((out.channels(), out.height(), out.width()), expected);
    let sources = sources.as_slice();
    let out = out.view_mut();
    if winograd_filter::fits(shape, height, width) {
        Arch::new().dispatch(winograd::Job { filter, sources, out });
    } else {
        Arch::new().dispatch(direct::Job { filter, sources, out });
    }
}
