-- Blind trials: recordings with hidden physics, diagnosed by every node that shares the library.

create table trial (
    -- Seed and hash of the rest, but for created_at: another program's trial is another one.
    id text not null primary key,
    -- Decides what is hidden in which case.
    seed integer not null,
    code_version text not null,
    model_hash text not null,
    created_at text not null
) strict, without rowid;

-- The seals: fixed before any diagnosis runs.
create table trial_case (
    trial_id text not null references trial (id),
    -- From 0.
    case_number integer not null,
    -- SHA-256 of the file that says what is hidden.
    truth_sha256 text not null,
    constraint a_case_is_sealed_once primary key (trial_id, case_number)
) strict, without rowid;

-- What was said of a case, scored after its seal was opened.
create table trial_answer (
    trial_id text not null,
    case_number integer not null,
    -- catalogue: with all names; knocked_out: without the hidden one; shuffled: with the sleepers of
    -- each speed in another order; paper: by surrogates and selector.
    question text not null,
    -- Null where the question is not a diagnosis's.
    diagnosis_id text references diagnosis (id),
    -- JSON.
    score text not null,
    worker text not null,
    answered_at text not null,
    constraint a_question_is_answered_once primary key (trial_id, case_number, question),
    constraint an_answer_belongs_to_a_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number),
    constraint question_is_known check (
        question in ('catalogue', 'knocked_out', 'shuffled', 'paper')),
    constraint score_is_json check (json_valid(score))
) strict, without rowid;

-- Who works on a case; nobody where there is no row, or the lease has expired.
create table trial_lease (
    trial_id text not null,
    case_number integer not null,
    worker text not null,
    lease_expires_unix_ms integer not null,
    constraint a_trial_case_has_one_lease primary key (trial_id, case_number),
    constraint a_lease_belongs_to_a_trial_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number)
) strict, without rowid;
