//! The threads of a render.

use rayon::prelude::*;

/// As many threads as asked for, or as the system grants.
pub(crate) struct Workers {
    /// `None` where it grants none: the calling thread does the work.
    pool: Option<rayon::ThreadPool>,
    refused: usize,
}

impl Workers {
    /// This many threads; 0 for one a core.
    pub(crate) fn start(threads: usize) -> Self {
        let wanted = Self::wanted(threads);
        // The first try lets rayon look at its environment, too.
        let mut count = threads;
        loop {
            match rayon::ThreadPoolBuilder::new().num_threads(count).build() {
                Ok(pool) if count == threads => return Self { pool: Some(pool), refused: 0 },
                Ok(pool) => return Self { pool: Some(pool), refused: wanted.saturating_sub(count) },
                Err(_) => count = if count == 0 { wanted / 2 } else { count / 2 },
            }
            if count == 0 {
                return Self { pool: None, refused: wanted - 1 };
            }
        }
    }

    /// How many are asked for: 0 is one a core.
    pub(crate) fn wanted(threads: usize) -> usize {
        match threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// How many more were asked for.
    pub(crate) fn refused(&self) -> usize {
        self.refused
    }

    /// Does a piece of work for each item.
    pub(crate) fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
        match &self.pool {
            Some(pool) => pool.install(|| items.par_iter_mut().for_each(work)),
            None => items.iter_mut().for_each(work),
        }
    }
}
