//! The model of an image: Gaussians, the spectra of their pixels, the tree over the spectra, and its lines.

use crate::gaussian::Gaussian;
use crate::hemispheres::Hemispheres;
use crate::image::{Image, Pixels};
use crate::mixture::Mixture;
use crate::slices::{Slice, slices};
use crate::space::{Points, Space};
use crate::tree::{Line, Tree};
use crate::{ColorLinesError, Settings, blocks, mixture};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Graph-based Color Lines of an image (thesis, sections 3.4 and 3.5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Whether a pixel belongs only to the Gaussians of its own hemisphere.
    pub constrained: bool,
    /// The space of the Gaussians.
    pub space: Space,
    /// The division of the space.
    pub hemispheres: Hemispheres,
    /// The Gaussians, by hemisphere.
    pub regions: Vec<Region>,
    /// The tree over the spectra of the regions. `None` with a spatial weight: lines are spectral.
    pub tree: Option<Tree>,
    /// All lines of the tree, longest first.
    pub lines: Vec<Line>,
}

/// A Gaussian and its pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Number of its hemisphere, from 0 at the origin.
    pub hemisphere: usize,
    /// Its weight is the weight in the mixture of its hemisphere.
    pub gaussian: Gaussian,
    /// Number of pixels of the modeled image.
    pub n_pixels: u64,
    /// Mean spectrum of these pixels by band, in units of the image.
    pub spectrum: Vec<f64>,
}

/// A model, and the regions of the modeled image.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Number of the region of each pixel, row by row, from 1; 0 if the pixel is invalid.
    pub labels: Vec<u32>,
    /// Iterations of expectation maximization, for each hemisphere with pixels.
    pub n_iterations: Vec<usize>,
}

impl Model {
    /// Models an image.
    pub fn fit(image: &Image<'_>, settings: &Settings) -> Result<Fit, ColorLinesError> {
        settings.check()?;
        let (pixels, space) = space(image, settings)?;
        let points = space.points(&pixels);
        let hemispheres = Hemispheres::new(&points, settings.hemispheres);
        let slices = slices(&points, &hemispheres, settings);
        let fit = |slice: &Slice| mixture::fit(&slice.points, mixture::start(&slice.points, &slice.means));
        let mixtures: Vec<Mixture> = slices.par_iter().map(fit).collect();
        let n_iterations = mixtures.iter().map(|mixture| mixture.n_iterations).collect();
        let mut regions = Vec::new();
        for (slice, mixture) in slices.iter().zip(mixtures) {
            regions.extend(mixture.gaussians.into_iter().map(|gaussian| Region {
                hemisphere: slice.hemisphere,
                gaussian,
                n_pixels: 0,
                spectrum: Vec::new(),
            }));
        }
        let constrained = settings.constrained;
        let mut model = Self { constrained, space, hemispheres, regions, tree: None, lines: Vec::new() };
        let mut region_of = vec![0; pixels.len()];
        for slice in &slices {
            let found = model.classify(&slice.points, slice.hemisphere);
            slice.order.iter().zip(found).for_each(|(pixel, region)| region_of[*pixel as usize] = region);
        }
        model.take_spectra(&pixels, &mut region_of);
        if settings.spatial_weight == 0.0 {
            let tree = Tree::new(&model.spectra());
            model.lines = tree.lines();
            model.tree = Some(tree);
        }
        let labels = labels(image, &pixels, &region_of);
        Ok(Fit { model, labels, n_iterations })
    }

    /// The hemispheres of an image and the starts of their mixtures, as in [`Model::fit`]; used to compare fits.
    pub fn slices(image: &Image<'_>, settings: &Settings) -> Result<Vec<Slice>, ColorLinesError> {
        settings.check()?;
        let (pixels, space) = space(image, settings)?;
        let points = space.points(&pixels);
        Ok(slices(&points, &Hemispheres::new(&points, settings.hemispheres), settings))
    }

    /// The regions of another image: the number of the region of each pixel, row by row, from 1; 0 if the pixel is
    /// invalid.
    pub fn labels(&self, image: &Image<'_>) -> Result<Vec<u32>, ColorLinesError> {
        self.check_bands(image)?;
        let pixels = image.pixels();
        let points = self.space.points(&pixels);
        let mut region_of = vec![0; pixels.len()];
        for (hemisphere, numbers) in self.hemispheres.sorted(&points).into_iter().enumerate() {
            let found = self.classify(&points.selected(&numbers), hemisphere);
            numbers.iter().zip(found).for_each(|(pixel, region)| region_of[*pixel as usize] = region);
        }
        Ok(labels(image, &pixels, &region_of))
    }

    /// The image with the mean spectrum of the region in each pixel, band-sequential. Pixels of label 0 are NaN.
    pub fn simplified(&self, image: &Image<'_>, labels: &[u32]) -> Result<Vec<f32>, ColorLinesError> {
        self.check_bands(image)?;
        if labels.len() != image.n_pixels() {
            return Err(ColorLinesError::Length { found: labels.len(), expected: image.n_pixels() });
        }
        if labels.iter().any(|label| *label as usize > self.regions.len()) {
            return Err(ColorLinesError::Model("has no region of one of the labels"));
        }
        let band = |band: usize| {
            let spectra = self.regions.iter().map(|region| region.spectrum[band] as f32);
            let by_label: Vec<f32> = std::iter::once(f32::NAN).chain(spectra).collect();
            labels.iter().map(move |label| by_label[*label as usize])
        };
        Ok((0..image.n_bands()).flat_map(band).collect())
    }

    /// The spectra of the regions, in units of the image.
    pub fn spectra(&self) -> Vec<Vec<f64>> {
        self.regions.iter().map(|region| region.spectrum.clone()).collect()
    }

    /// Number of bands.
    pub fn n_bands(&self) -> usize {
        self.regions.first().map_or(0, |region| region.spectrum.len())
    }

    /// Reads the text of a `model.json` of `replica-lab spectrum lines`.
    ///
    /// # Errors
    /// If it is not a model, or its parts contradict each other.
    pub fn from_json(text: &str) -> Result<Self, ColorLinesError> {
        let model: Self = serde_json::from_str(text).map_err(|error| ColorLinesError::Json(error.to_string()))?;
        model.check()?;
        Ok(model)
    }

    /// Checks a model from a file: parts that contradict each other would later cause a panic or wrong results.
    pub fn check(&self) -> Result<(), ColorLinesError> {
        let n_bands = self.n_bands();
        let n_channels = n_bands + if self.space.spatial_weight > 0.0 { 2 } else { 0 };
        let rule = |holds: bool, what| if holds { Ok(()) } else { Err(ColorLinesError::Model(what)) };
        rule(n_bands > 0, "has no regions with a spectrum")?;
        rule(self.regions.iter().all(|region| region.spectrum.len() == n_bands), "has spectra of different lengths")?;
        rule(
            self.regions.is_sorted_by_key(|region| region.hemisphere),
            "has regions that are not sorted by hemisphere",
        )?;
        let has_channels = |values: &Vec<f64>| values.len() == n_channels;
        rule(
            has_channels(&self.space.mean) && self.space.axes.iter().all(has_channels),
            "has a space of other channels",
        )?;
        rule(self.space.scale > 0.0 && self.hemispheres.width >= 0.0, "has a scale or a width that is not positive")?;
        // Far above the result of any fit; differences and squares of such numbers stay finite.
        let is_bounded = |value: &f64| value.abs() <= 1e6;
        let mut axes = self.space.axes.iter().flatten().chain(&self.space.mean);
        rule(axes.all(is_bounded), "has a space with numbers above 1e6")?;
        let is_gaussian = |region: &Region| {
            let factors = region.gaussian.normalized(1.0).map(|normalized| normalized.factor);
            region.gaussian.mean.iter().all(is_bounded) && factors.is_some_and(|factors| factors.iter().all(is_bounded))
        };
        rule(self.regions.iter().all(is_gaussian), "has a Gaussian that is not positive definite or beyond 1e6")?;
        rule((1..=64).contains(&self.hemispheres.n), "has no or more than 64 hemispheres")?;
        let is_node = |node: &usize| *node <= self.regions.len();
        rule(
            self.lines.iter().all(|line| !line.nodes.is_empty() && line.nodes.iter().all(is_node)),
            "has a line of no or unknown nodes",
        )?;
        let is_tree = |tree: &Tree| {
            tree.toward_origin.len() == self.regions.len() && tree.toward_origin.iter().all(|(node, _)| is_node(node))
        };
        rule(self.tree.as_ref().is_none_or(is_tree), "has a tree that does not match its regions")
    }

    /// Whether an image has the bands of the model.
    pub(crate) fn check_bands(&self, image: &Image<'_>) -> Result<(), ColorLinesError> {
        let found = image.n_bands();
        let expected = self.n_bands();
        if found == expected { Ok(()) } else { Err(ColorLinesError::Bands { found, expected }) }
    }

    /// The region of each point of a hemisphere.
    fn classify(&self, points: &Points, hemisphere: usize) -> Vec<u32> {
        let first = self.regions.partition_point(|region| region.hemisphere < hemisphere);
        let end = self.regions.partition_point(|region| region.hemisphere <= hemisphere);
        // In another image than the modeled one, a hemisphere without Gaussians uses the Gaussians of all hemispheres.
        let (first, end, constrained) =
            if self.constrained && first < end { (first, end, true) } else { (0, self.regions.len(), false) };
        let weighted = |region: &Region| Gaussian {
            weight: if constrained { region.gaussian.weight } else { 1.0 },
            ..region.gaussian
        };
        let gaussians: Vec<Gaussian> = self.regions[first..end].iter().map(weighted).collect();
        let mut found = blocks::classify(points, &mixture::normalized(&gaussians));
        for region in &mut found {
            *region += first as u32;
        }
        found
    }

    /// Computes the pixel counts and spectra of the regions, and removes regions without pixels.
    fn take_spectra(&mut self, pixels: &Pixels, region_of: &mut [u32]) {
        let mut n_pixels = vec![0_u64; self.regions.len()];
        for region in &*region_of {
            n_pixels[*region as usize] += 1;
        }
        for band in &pixels.bands {
            let mut sums = vec![0.0; self.regions.len()];
            region_of.iter().zip(band).for_each(|(region, value)| sums[*region as usize] += f64::from(*value));
            for (region, (sum, n)) in self.regions.iter_mut().zip(sums.iter().zip(&n_pixels)) {
                region.spectrum.push(sum / *n as f64);
            }
        }
        let mut kept = 0;
        let number: Vec<u32> = (n_pixels.iter())
            .map(|n| {
                kept += u32::from(*n > 0);
                kept.saturating_sub(1)
            })
            .collect();
        for region in region_of {
            *region = number[*region as usize];
        }
        self.regions.iter_mut().zip(&n_pixels).for_each(|(region, n)| region.n_pixels = *n);
        self.regions.retain(|region| region.n_pixels > 0);
    }
}

/// Labels of all pixels of an image from the regions of its valid pixels.
fn labels(image: &Image<'_>, pixels: &Pixels, region_of: &[u32]) -> Vec<u32> {
    let mut labels = vec![0; image.n_pixels()];
    pixels.at.iter().zip(region_of).for_each(|(at, region)| labels[*at as usize] = region + 1);
    labels
}

/// The valid pixels of an image, and their space.
fn space(image: &Image<'_>, settings: &Settings) -> Result<(Pixels, Space), ColorLinesError> {
    let scale = f64::from(image.largest());
    let pixels = image.pixels();
    if pixels.len() == 0 || scale <= 0.0 {
        return Err(ColorLinesError::Empty);
    }
    let space = Space::new(&pixels, scale, settings.spatial_weight);
    Ok((pixels, space))
}
