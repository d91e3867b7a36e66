//! The settings of one training.

use segmentation::network::NetworkSpec;
use segmentation::points::PointNetworkSpec;
use serde::{Deserialize, Serialize};
use training::{Loss, TrainSettings};

/// Largest number of epochs, as in the thesis' published code.
pub const EPOCHS: usize = 100;
/// Training ends if the validation loss has not fallen for this number of epochs (section 5.6.2 and the published code).
pub const PATIENCE: usize = 5;

/// A network on images or on points. Files contain only the fields of its variant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Architecture {
    Images(NetworkSpec),
    Points(PointNetworkSpec),
}

/// Everything that determines a training except the data itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Row of the table, for example the loss.
    pub row: String,
    /// Column of the table, for example the filters and the batch.
    pub column: String,
    /// Description of the data; trainings with equal descriptions use the same data.
    pub data: String,
    pub network: Architecture,
    /// Variables whose names start with one of these are not changed.
    pub frozen: Vec<String>,
    /// The training whose best weights this one starts from; `None`: random weights.
    pub start: Option<Box<Recipe>>,
    /// The training whose confusions in validation determine the class tree; `None`: the tree of the thesis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tree_of: Option<Box<Recipe>>,
    pub settings: TrainSettings,
}

impl Recipe {
    /// Name of the training in its table, and of its folder.
    pub fn name(&self) -> String {
        let text = format!("{}_{}_seed-{}", self.column, self.row, self.settings.seed).to_lowercase();
        let of_file = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_') { c } else { '-' };
        let with_dashes: String = text.replace(", ", "-").replace(". ", ".").chars().map(of_file).collect();
        with_dashes.replace("---", "-")
    }
    /// The trainings that must be finished before this one.
    pub fn sources(&self) -> impl Iterator<Item = &Recipe> {
        [&self.start, &self.tree_of].into_iter().filter_map(Option::as_deref)
    }
    /// Filters of the first level of a network on images.
    pub fn filters(&self) -> usize {
        match &self.network {
            Architecture::Images(NetworkSpec::Unet { widths, .. } | NetworkSpec::SphericalDz { widths, .. }) => {
                widths.first().copied().unwrap_or(0)
            }
            Architecture::Points(_) => 0,
        }
    }
}

/// Settings that all trainings share: until convergence, with all pixels.
pub fn settings(batch: usize, learning_rate: f64, loss: Loss, seed: u64) -> TrainSettings {
    TrainSettings {
        seed,
        epochs: EPOCHS,
        batch,
        learning_rate,
        average: 0.0,
        fixed_statistics: 1.0,
        consistency: 0.0,
        bev_head: 0.0,
        patience: PATIENCE,
        loss,
        hierarchy: false,
        pixels: 0,
    }
}

/// A U-Net of three levels: filters, twice and four times as many.
pub fn unet(inputs: usize, outputs: usize, filters: usize) -> Architecture {
    let widths = vec![filters, 2 * filters, 4 * filters];
    Architecture::Images(NetworkSpec::Unet { inputs, outputs, widths, head: None })
}
