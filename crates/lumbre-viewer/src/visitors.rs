//! Connections: admitted pages, and strangers, who displace each other but never a page.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// Maximum connections that are not admitted. One more ends the oldest.
const MAX_STRANGERS: usize = 192;
/// Maximum admitted connections.
const MAX_GUESTS: usize = 256;

/// All connections.
#[derive(Debug, Default)]
pub(crate) struct Visitors(Mutex<Inner>);

#[derive(Debug, Default)]
struct Inner {
    count: u64,
    /// The oldest first.
    strangers: VecDeque<(u64, Arc<Notify>)>,
    guests: usize,
}

/// One connection, as long as it lives.
#[derive(Debug)]
pub(crate) struct Visit {
    visitors: Arc<Visitors>,
    number: u64,
    gives_way: Arc<Notify>,
    is_guest: AtomicBool,
}

impl Visitors {
    /// A new connection.
    pub(crate) fn come(self: &Arc<Self>) -> Visit {
        let gives_way = Arc::new(Notify::new());
        let mut inner = self.lock();
        if inner.strangers.len() >= MAX_STRANGERS
            && let Some((_, oldest)) = inner.strangers.pop_front()
        {
            // Stored for a connection that is not waiting yet.
            oldest.notify_one();
        }
        let number = inner.count;
        inner.count += 1;
        inner.strangers.push_back((number, gives_way.clone()));
        drop(inner);
        Visit { visitors: self.clone(), number, gives_way, is_guest: AtomicBool::new(false) }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Visit {
    /// Admits the connection; returns whether there was a place. A displaced connection has none.
    pub(crate) fn let_in(&self) -> bool {
        let mut inner = self.visitors.lock();
        if self.is_guest.load(Ordering::Relaxed) {
            return true;
        }
        match inner.place(self.number) {
            Some(place) if inner.guests < MAX_GUESTS => {
                inner.strangers.remove(place);
                inner.guests += 1;
                self.is_guest.store(true, Ordering::Relaxed);
                true
            }
            _ => false,
        }
    }

    /// Whether it was admitted.
    pub(crate) fn is_guest(&self) -> bool {
        self.is_guest.load(Ordering::Relaxed)
    }

    /// Waits until it is displaced.
    pub(crate) async fn gives_way(&self) {
        self.gives_way.notified().await;
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        let mut inner = self.visitors.lock();
        if self.is_guest.load(Ordering::Relaxed) {
            inner.guests -= 1;
        } else if let Some(place) = inner.place(self.number) {
            inner.strangers.remove(place);
        }
    }
}

impl Inner {
    fn place(&self, number: u64) -> Option<usize> {
        self.strangers.binary_search_by_key(&number, |(known, _)| *known).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strangers_give_way_to_strangers_and_guests_to_no_one() {
        let visitors = Arc::new(Visitors::default());
        let has_to_go = |visit: &Visit| {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
            let wait = std::time::Duration::from_millis(1);
            runtime.block_on(async { tokio::time::timeout(wait, visit.gives_way()).await.is_ok() })
        };
        let guest = visitors.come();
        assert!(guest.let_in() && guest.let_in());
        let first = visitors.come();
        let many: Vec<Visit> = (1..MAX_STRANGERS).map(|_| visitors.come()).collect();
        assert!(!has_to_go(&first));
        let late = visitors.come();
        assert!(has_to_go(&first) && !first.let_in(), "the oldest has to go");
        assert!(!has_to_go(&many[0]) && !has_to_go(&late) && !has_to_go(&guest));
        assert!(late.let_in());
        drop((first, many));
        let counted = || {
            let inner = visitors.lock();
            (inner.strangers.len(), inner.guests)
        };
        assert_eq!(counted(), (0, 2));
        let comes_in = |_| {
            let visit = visitors.come();
            assert!(visit.let_in());
            visit
        };
        let guests: Vec<Visit> = (2..MAX_GUESTS).map(comes_in).collect();
        assert!(!visitors.come().let_in(), "all places are taken");
        drop((guest, late, guests));
        assert_eq!(counted(), (0, 0));
    }
}
