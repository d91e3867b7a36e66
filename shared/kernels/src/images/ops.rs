//! The kernels as operations of candle. They write the pixels and the border of an existing tensor, because clearing new memory
//! takes a tenth of a run: `out.inplace_op2(&source, &MaxPool { .. })` writes to `out`.

use super::convolution::convolve;
use super::filter::Filter;
use super::planes::{Border, LANES, PlanesRef};
use super::resample::{max_pool, upsample};
use super::tensors::{planes_mut_of, planes_of, written};
use candle_core::{CpuStorage, InplaceOp2, InplaceOp3, Layout, Result, bail};

/// Memory and layout of a tensor.
type Source<'a> = (&'a CpuStorage, &'a Layout);

/// Convolution of one source, or of two that are concatenated along the channels.
pub struct Convolution<'a> {
    /// Weights and biases.
    pub filter: &'a Filter,
    /// Border of the output.
    pub border: Border,
}

impl Convolution<'_> {
    fn apply(&self, out: &mut CpuStorage, layout: &Layout, sources: &[Source<'_>]) -> Result<()> {
        let shape = &self.filter.shape;
        if sources.len() != shape.in_channels.len() {
            bail!("convolution of {} sources; the filter has {}", sources.len(), shape.in_channels.len());
        }
        let sources = sources.iter().zip(&shape.in_channels);
        let sources: Vec<PlanesRef<'_>> =
            sources.map(|((storage, layout), &n)| planes_of(storage, layout, n)).collect::<Result<_>>()?;
        let mut out = planes_mut_of(out, layout, shape.out_channels)?;
        let height = sources[0].height();
        let width = sources[0].width();
        let is_equal = sources.iter().all(|source| (source.height(), source.width()) == (height, width));
        let fits = (out.height(), out.width() * shape.stride_x) == (height, width);
        if !(is_equal && fits) {
            let found: Vec<_> = sources.iter().map(|source| [source.height(), source.width()]).collect();
            let out = [out.height(), out.width()];
            let stride = shape.stride_x;
            bail!("convolution of images of {found:?} rows, columns to one of {out:?}, stride {stride}");
        }
        written(&mut out, self.border, |out| convolve(self.filter, &sources.iter().collect::<Vec<_>>(), out))
    }
}

impl InplaceOp2 for Convolution<'_> {
    fn name(&self) -> &'static str {
        "convolution"
    }
    fn cpu_fwd(&self, out: &mut CpuStorage, l0: &Layout, source: &CpuStorage, l1: &Layout) -> Result<()> {
        self.apply(out, l0, &[(source, l1)])
    }
}

impl InplaceOp3 for Convolution<'_> {
    fn name(&self) -> &'static str {
        "convolution"
    }
    fn cpu_fwd(
        &self,
        out: &mut CpuStorage,
        l0: &Layout,
        first: &CpuStorage,
        l1: &Layout,
        second: &CpuStorage,
        l2: &Layout,
    ) -> Result<()> {
        self.apply(out, l0, &[(first, l1), (second, l2)])
    }
}

/// The maximum of each window.
pub struct MaxPool {
    /// Rows and columns of a window.
    pub factor: [usize; 2],
    /// Border of the output.
    pub border: Border,
}

impl InplaceOp2 for MaxPool {
    fn name(&self) -> &'static str {
        "max_pool"
    }
    fn cpu_fwd(&self, out: &mut CpuStorage, l0: &Layout, source: &CpuStorage, l1: &Layout) -> Result<()> {
        // The padding channels of the last block are zero, before and after.
        let image = planes_of(source, l1, channels(l1))?;
        let mut out = planes_mut_of(out, l0, channels(l0))?;
        expect_multiple(&image, &out.view(), self.factor)?;
        written(&mut out, self.border, |out| max_pool(&image, self.factor, out))
    }
}

/// Repeats every pixel.
pub struct Upsample {
    /// Rows and columns that get the value of a pixel.
    pub factor: [usize; 2],
    /// Border of the output.
    pub border: Border,
}

impl InplaceOp2 for Upsample {
    fn name(&self) -> &'static str {
        "upsample"
    }
    fn cpu_fwd(&self, out: &mut CpuStorage, l0: &Layout, source: &CpuStorage, l1: &Layout) -> Result<()> {
        let image = planes_of(source, l1, channels(l1))?;
        let mut out = planes_mut_of(out, l0, channels(l0))?;
        expect_multiple(&out.view(), &image, self.factor)?;
        written(&mut out, self.border, |out| upsample(&image, self.factor, out))
    }
}

/// Channels of an image, with the padding channels.
fn channels(layout: &Layout) -> usize {
    layout.dims().first().map_or(0, |n_blocks| n_blocks * LANES)
}

fn expect_multiple(large: &PlanesRef<'_>, small: &PlanesRef<'_>, [rows, columns]: [usize; 2]) -> Result<()> {
    let [found, of] = [large, small].map(|image| [image.channels(), image.height(), image.width()]);
    if found != [of[0], of[1] * rows, of[2] * columns] {
        bail!("an image of {found:?} channels, rows, columns is not {rows} x {columns} times one of {of:?}");
    }
    Ok(())
}
