//! Brings each submap together with its columns, which may come in later ticks.

use crate::columns::{Columns, SavedColumns};
use messages::{Class, Color, Instance, Message, Spectra, Submap};
use serde::{Deserialize, Serialize};
use stage::{Inputs, Received, StepError};

/// Which optional columns somebody publishes in this run and export is to write.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    pub(crate) color: bool,
    pub(crate) spectra: bool,
    pub(crate) class: bool,
    pub(crate) instance: bool,
}

/// A submap with all that is said about its points.
pub(crate) struct Joined {
    pub(crate) submap: Received<Submap>,
    pub(crate) color: Option<Received<Color>>,
    pub(crate) spectra: Option<Received<Spectra>>,
    pub(crate) class: Option<Received<Class>>,
    pub(crate) instance: Option<Received<Instance>>,
    /// Live mode: columns that were published and never arrived.
    pub(crate) lost: Vec<String>,
}

/// Submaps that wait for columns, and columns that wait for their submap.
pub(crate) struct Join {
    is_live: bool,
    submaps: Columns<Submap>,
    color: Columns<Color>,
    spectra: Columns<Spectra>,
    class: Columns<Class>,
    instance: Columns<Instance>,
}

/// [`Join`] as bytes.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedJoin {
    columns: Vec<SavedColumns>,
}

impl Join {
    pub(crate) fn new(expected: Expected, is_live: bool) -> Self {
        Self {
            is_live,
            submaps: Columns::new(true),
            color: Columns::new(expected.color),
            spectra: Columns::new(expected.spectra),
            class: Columns::new(expected.class),
            instance: Columns::new(expected.instance),
        }
    }

    /// Topics without a producer.
    pub(crate) fn absent_topics(&self) -> Vec<&'static str> {
        let expected = [
            (Color::TOPIC, self.color.is_expected()),
            (Spectra::TOPIC, self.spectra.is_expected()),
            (Class::TOPIC, self.class.is_expected()),
            (Instance::TOPIC, self.instance.is_expected()),
        ];
        expected.iter().filter(|(_, is_expected)| !is_expected).map(|(topic, _)| *topic).collect()
    }

    /// Takes the tick's messages.
    pub(crate) fn take(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        self.submaps.take(inputs, self.is_live)?;
        self.color.take(inputs, self.is_live)?;
        self.spectra.take(inputs, self.is_live)?;
        self.class.take(inputs, self.is_live)?;
        self.instance.take(inputs, self.is_live)
    }

    /// The oldest submap, once nothing that is expected of it can still come.
    pub(crate) fn next_complete(&mut self) -> Option<Joined> {
        let seq = self.submaps.front_seq()?;
        let settled = self.color.is_settled(seq)
            && self.spectra.is_settled(seq)
            && self.class.is_settled(seq)
            && self.instance.is_settled(seq);
        // Live, a column may have been dropped with nothing after it; the bound on held submaps decides then.
        if !settled && !(self.is_live && self.submaps.len() > Submap::BORROWED) {
            return None;
        }
        let submap = self.submaps.take_seq(seq)?;
        let mut joined = Joined {
            submap,
            color: self.color.take_seq(seq),
            spectra: self.spectra.take_seq(seq),
            class: self.class.take_seq(seq),
            instance: self.instance.take_seq(seq),
            lost: Vec::new(),
        };
        let columns = [
            (Color::TOPIC, self.color.is_expected() && joined.color.is_none()),
            (Spectra::TOPIC, self.spectra.is_expected() && joined.spectra.is_none()),
            (Class::TOPIC, self.class.is_expected() && joined.class.is_none()),
            (Instance::TOPIC, self.instance.is_expected() && joined.instance.is_none()),
        ];
        joined.lost = columns.iter().filter(|(_, lost)| *lost).map(|(topic, _)| (*topic).to_owned()).collect();
        Some(joined)
    }

    /// Upstream stages work in order and hold a bounded number of submaps, so their columns arrive in bounded time.
    pub(crate) fn check_bounds(&self) -> Result<(), StepError> {
        if self.submaps.len() > Submap::BORROWED {
            return Err(self.waiting(&format!("{} submaps are held, {} may be", self.submaps.len(), Submap::BORROWED)));
        }
        self.color.check_bound()?;
        self.spectra.check_bound()?;
        self.class.check_bound()?;
        self.instance.check_bound()
    }

    /// At the end of the stream.
    pub(crate) fn check_empty(&self) -> Result<(), StepError> {
        if self.submaps.len() > 0 && !self.is_live { Err(self.waiting("the stream has ended")) } else { Ok(()) }
    }

    fn waiting(&self, why: &str) -> StepError {
        let seq = self.submaps.front_seq().unwrap_or_default();
        let topics = [
            (Color::TOPIC, self.color.is_settled(seq)),
            (Spectra::TOPIC, self.spectra.is_settled(seq)),
            (Class::TOPIC, self.class.is_settled(seq)),
            (Instance::TOPIC, self.instance.is_settled(seq)),
        ];
        let missing: Vec<&str> = topics.iter().filter(|(_, settled)| !settled).map(|(topic, _)| *topic).collect();
        StepError::Contract(format!("submap {seq} still waits for {}, but {why}", missing.join(" and ")))
    }

    pub(crate) fn save(&self) -> SavedJoin {
        let columns =
            vec![self.submaps.save(), self.color.save(), self.spectra.save(), self.class.save(), self.instance.save()];
        SavedJoin { columns }
    }

    pub(crate) fn load(&mut self, saved: &SavedJoin) -> Result<(), StepError> {
        let [submaps, color, spectra, class, instance] = saved.columns.as_slice() else {
            return Err(StepError::data(format!("saved state has {} topics, must be 5", saved.columns.len())));
        };
        self.submaps.load(submaps)?;
        self.color.load(color)?;
        self.spectra.load(spectra)?;
        self.class.load(class)?;
        self.instance.load(instance)
    }
}
