//! Brings each submap together with its columns, which may come in later ticks.

use crate::columns::{Columns, SavedColumns};
use messages::{Class, Color, Instance, Message, Spectra, Submap};
use serde::{Deserialize, Serialize};
use stage::{Inputs, Received, StateBytes, StepError};

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

/// [`Join`] without its messages, which follow in the saved state.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedJoin {
    columns: [SavedColumns; 5],
}

impl Join {
    /// `is_expected` tells by topic which columns every submap will get.
    pub(crate) fn new(is_expected: impl Fn(&str) -> bool, is_live: bool) -> Self {
        Self {
            is_live,
            submaps: Columns::new(true),
            color: Columns::new(is_expected(Color::TOPIC)),
            spectra: Columns::new(is_expected(Spectra::TOPIC)),
            class: Columns::new(is_expected(Class::TOPIC)),
            instance: Columns::new(is_expected(Instance::TOPIC)),
        }
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
    pub(crate) fn next_complete(&mut self, is_end: bool) -> Option<Joined> {
        let seq = self.submaps.front_seq()?;
        let is_settled = self.color.is_settled(seq)
            && self.spectra.is_settled(seq)
            && self.class.is_settled(seq)
            && self.instance.is_settled(seq);
        // Live, a column may have been dropped with nothing after it; the bound on held submaps decides then.
        if !is_settled && !(self.is_live && (is_end || self.submaps.len() > Submap::BORROWED)) {
            return None;
        }
        let lost = self.missing(seq).into_iter().map(str::to_owned).collect();
        Some(Joined {
            submap: self.submaps.take_seq(seq)?,
            color: self.color.take_seq(seq),
            spectra: self.spectra.take_seq(seq),
            class: self.class.take_seq(seq),
            instance: self.instance.take_seq(seq),
            lost,
        })
    }

    /// Topics whose column of submap `seq` is not here.
    fn missing(&self, seq: u64) -> Vec<&'static str> {
        let topics =
            [self.color.missing(seq), self.spectra.missing(seq), self.class.missing(seq), self.instance.missing(seq)];
        topics.into_iter().flatten().collect()
    }

    /// Upstream stages work in order and hold a bounded number of submaps, so their columns arrive in bounded time; live,
    /// some do not arrive.
    pub(crate) fn check_bounds(&mut self) -> Result<(), StepError> {
        if self.is_live {
            self.color.trim();
            self.spectra.trim();
            self.class.trim();
            self.instance.trim();
            return Ok(());
        }
        if self.submaps.len() > Submap::BORROWED {
            return Err(self.waiting(&format!("{} submaps are held, {} may be", self.submaps.len(), Submap::BORROWED)));
        }
        self.color.check_bound()?;
        self.spectra.check_bound()?;
        self.class.check_bound()?;
        self.instance.check_bound()
    }

    /// At the end of the stream nothing may be left.
    pub(crate) fn check_empty(&self) -> Result<(), StepError> {
        if self.submaps.len() == 0 { Ok(()) } else { Err(self.waiting("the stream has ended")) }
    }

    fn waiting(&self, why: &str) -> StepError {
        let seq = self.submaps.front_seq().unwrap_or_default();
        StepError::Contract(format!("submap {seq} still waits for {}, but {why}", self.missing(seq).join(" and ")))
    }

    pub(crate) fn save(&self) -> SavedJoin {
        let columns =
            [self.submaps.save(), self.color.save(), self.spectra.save(), self.class.save(), self.instance.save()];
        SavedJoin { columns }
    }

    pub(crate) fn save_messages<'a>(&'a self, state: &mut StateBytes<'a>) {
        self.submaps.save_messages(state);
        self.color.save_messages(state);
        self.spectra.save_messages(state);
        self.class.save_messages(state);
        self.instance.save_messages(state);
    }

    /// `messages` are those of [`Join::save_messages`].
    pub(crate) fn load(&mut self, saved: &SavedJoin, mut messages: &[u8]) -> Result<(), StepError> {
        let [submaps, color, spectra, class, instance] = &saved.columns;
        self.submaps.load(submaps, &mut messages)?;
        self.color.load(color, &mut messages)?;
        self.spectra.load(spectra, &mut messages)?;
        self.class.load(class, &mut messages)?;
        self.instance.load(instance, &mut messages)?;
        if messages.is_empty() {
            return Ok(());
        }
        Err(StepError::data(format!("saved state: {} bytes more than its head says", messages.len())))
    }
}
