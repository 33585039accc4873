-- Blind trials: recordings with hidden physics, diagnosed by every node that shares the library.

create table trial (
    -- Seed and hash of the rest, but for created_at: another program's trial is another one.
    id text collate "C" not null primary key,
    -- Decides what is hidden in which case.
    seed bigint not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    created_at text collate "C" not null
);

-- The seals: fixed before any diagnosis runs.
create table trial_case (
    trial_id text collate "C" not null references trial (id),
    -- From 0.
    case_number bigint not null,
    -- SHA-256 of the file that says what is hidden.
    truth_sha256 text collate "C" not null,
    constraint a_case_is_sealed_once primary key (trial_id, case_number)
);

-- What was said of a case, scored after its seal was opened.
create table trial_answer (
    trial_id text collate "C" not null,
    case_number bigint not null,
    -- catalogue: with all names; knocked_out: without the hidden one; shuffled: with the sleepers of
    -- each speed in another order; paper: by surrogates and selector.
    question text collate "C" not null,
    -- Null where the question is not a diagnosis's.
    diagnosis_id text collate "C" references diagnosis (id),
    -- JSON.
    score text collate "C" not null,
    worker text collate "C" not null,
    answered_at text collate "C" not null,
    constraint a_question_is_answered_once primary key (trial_id, case_number, question),
    constraint an_answer_belongs_to_a_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number),
    constraint question_is_known check (
        question in ('catalogue', 'knocked_out', 'shuffled', 'paper')),
    constraint score_is_json check (score::jsonb is not null)
);

-- Who works on a case; nobody where there is no row, or the lease has expired.
create table trial_lease (
    trial_id text collate "C" not null,
    case_number bigint not null,
    worker text collate "C" not null,
    lease_expires_unix_ms bigint not null,
    constraint a_trial_case_has_one_lease primary key (trial_id, case_number),
    constraint a_lease_belongs_to_a_trial_case foreign key (trial_id, case_number)
        references trial_case (trial_id, case_number)
);
