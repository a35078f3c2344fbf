//! Work on many threads, in the order of what is worked on.

use std::collections::VecDeque;
use std::sync::mpsc;

use rayon::ThreadPool;

/// Calls `work` on the threads of `pool` for each item of `next`, and `take` on the calling thread for each answer, in
/// the order of the items; without a pool, all on the calling thread. No more than a few items a thread are held at a
/// time. It ends at the first error, in that order.
///
/// # Errors
/// The first of any of the three.
pub(super) fn in_order<Item: Send, Answer: Send, E: Send>(
    pool: Option<&ThreadPool>,
    mut next: impl FnMut() -> Result<Option<Item>, E>,
    work: impl Fn(Item) -> Result<Answer, E> + Sync,
    mut take: impl FnMut(Answer) -> Result<(), E>,
) -> Result<(), E> {
    let Some(pool) = pool else {
        while let Some(item) = next()? {
            take(work(item)?)?;
        }
        return Ok(());
    };
    let most = 2 * pool.current_num_threads() + 2;
    let work = &work;
    pool.in_place_scope(|scope| {
        let mut waiting = VecDeque::new();
        let mut end = None;
        loop {
            while end.is_none() && waiting.len() < most {
                match next() {
                    Ok(Some(item)) => {
                        let (sender, receiver) = mpsc::sync_channel(1);
                        scope.spawn(move |_| drop(sender.send(work(item))));
                        waiting.push_back(receiver);
                    }
                    Ok(None) => end = Some(Ok(())),
                    Err(e) => end = Some(Err(e)),
                }
            }
            match waiting.pop_front().map(|answer| answer.recv()) {
                Some(Ok(answer)) => take(answer?)?,
                // The scope passes a panic on.
                Some(Err(_)) => return Ok(()),
                None => return end.unwrap_or(Ok(())),
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// Counts to `end`, fails at `bad` in the place that is named, and answers what was taken.
    fn run(threads: usize, bad: (&str, u64)) -> (Result<(), (String, u64)>, Vec<u64>) {
        let pool =
            (threads > 0).then(|| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
        let check = |place: &str, i| if bad == (place, i) { Err((place.to_owned(), i)) } else { Ok(i) };
        let mut taken = Vec::new();
        let mut numbers = 0..100;
        let done = in_order(
            pool.as_ref(),
            || numbers.next().map(|i| check("next", i)).transpose(),
            |i| {
                // The first ones end last.
                std::thread::sleep(Duration::from_micros(300 * (7 - i % 7)));
                // What a later item does wrong is not found first.
                if 60 < i { Err(("late".to_owned(), i)) } else { check("work", i) }
            },
            |i| {
                taken.push(check("take", i)?);
                Ok(())
            },
        );
        (done, taken)
    }

    #[test]
    fn answers_come_in_order_until_the_first_error() {
        for threads in [0, 1, 2, 5] {
            for place in ["next", "work", "take"] {
                let (done, taken) = run(threads, (place, 37));
                assert_eq!(done, Err((place.to_owned(), 37)));
                assert_eq!(taken, (0..37).collect::<Vec<_>>());
            }
            assert_eq!(run(threads, ("", 0)).0, Err(("late".to_owned(), 61)));
        }
    }
}
