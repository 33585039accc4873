-- What a farm of several campaigns, coordinators and workers needs beside the cases themselves.

alter table campaign add column state text collate "C" not null default 'running'
    constraint campaign_state_is_known check (state in ('running', 'paused', 'cancelled'));

-- The larger goes first.
alter table campaign add column priority bigint not null default 0;

-- When the present lease, or the last one, began; by the coordinator's clock.
alter table campaign_case add column leased_unix_ms bigint;

-- How many cases stand where, kept by triggers: a million cases are counted at once. Each connection
-- counts in rows of its own, so that coordinators don't wait for each other; the sum over writers
-- counts, and that of a single writer may be negative.
create table case_count (
    campaign_id text collate "C" not null references campaign (id),
    state text collate "C" not null,
    writer bigint not null,
    cases bigint not null,
    constraint a_writer_counts_once primary key (campaign_id, state, writer)
);

insert into case_count (campaign_id, state, writer, cases)
select campaign_id, state, 0, count(*) from campaign_case group by campaign_id, state;

create function count_cases() returns trigger language plpgsql as $$
begin
    if tg_op = 'INSERT' then
        insert into case_count (campaign_id, state, writer, cases)
        select campaign_id, state, pg_backend_pid(), count(*) from inserted
        group by campaign_id, state order by campaign_id, state
        on conflict (campaign_id, state, writer)
        do update set cases = case_count.cases + excluded.cases;
    elsif tg_op = 'UPDATE' then
        insert into case_count (campaign_id, state, writer, cases)
        select campaign_id, state, pg_backend_pid(), sum(change) from (
            select campaign_id, state, 1 as change from inserted
            union all
            select campaign_id, state, -1 as change from deleted) as changed
        group by campaign_id, state having sum(change) <> 0 order by campaign_id, state
        on conflict (campaign_id, state, writer)
        do update set cases = case_count.cases + excluded.cases;
    else
        insert into case_count (campaign_id, state, writer, cases)
        select campaign_id, state, pg_backend_pid(), -count(*) from deleted
        group by campaign_id, state order by campaign_id, state
        on conflict (campaign_id, state, writer)
        do update set cases = case_count.cases + excluded.cases;
    end if;
    return null;
end $$;

create trigger count_inserted_case after insert on campaign_case
    referencing new table as inserted for each statement execute function count_cases();

create trigger count_updated_case after update on campaign_case
    referencing old table as deleted new table as inserted
    for each statement execute function count_cases();

create trigger count_deleted_case after delete on campaign_case
    referencing old table as deleted for each statement execute function count_cases();

-- Leases that ended without a result: who had them, and how they ended. Those that brought one stand
-- in result.
create table attempt (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    epoch bigint not null,
    worker text collate "C" not null,
    leased_unix_ms bigint,
    ended_unix_ms bigint not null,
    ending text collate "C" not null,
    error text collate "C",
    constraint a_lease_ends_once primary key (campaign_id, sobol_index, epoch),
    constraint an_attempt_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    -- failed: could not be simulated; lost: the lease expired; returned: handed back;
    -- cancelled: with its campaign; abandoned: found held when a lone coordinator started;
    -- overtaken: an earlier lease's result came after all.
    constraint ending_is_known check (
        ending in ('failed', 'lost', 'returned', 'cancelled', 'abandoned', 'overtaken'))
);

create table worker (
    id text collate "C" not null primary key,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    cores bigint not null,
    state text collate "C" not null default 'active',
    -- Why it is in quarantine.
    reason text collate "C",
    registered_unix_ms bigint not null,
    last_seen_unix_ms bigint not null,
    cases_finished bigint not null default 0,
    cases_failed bigint not null default 0,
    failures_in_a_row bigint not null default 0,
    -- Computing time of the finished cases.
    busy_s double precision not null default 0,
    constraint worker_state_is_known check (state in ('active', 'quarantined')),
    constraint quarantined_for_a_reason check (state = 'active' or reason is not null)
);

-- What was done in each ten seconds: rates, and the history of a campaign.
create table progress (
    campaign_id text collate "C" not null references campaign (id),
    from_unix_s bigint not null,
    writer bigint not null,
    finished bigint not null,
    failed bigint not null,
    busy_s double precision not null,
    constraint a_writer_tells_once primary key (campaign_id, from_unix_s, writer)
);

-- Finished cases that another worker is to simulate again, and what came of it.
create table audit (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    -- Whose result is looked at.
    worker text collate "C" not null,
    state text collate "C" not null default 'waiting',
    auditor text collate "C",
    lease_expires_unix_ms bigint,
    -- Largest difference of a band level between the two.
    difference_dB double precision,
    ended_unix_ms bigint,
    constraint a_case_is_audited_once primary key (campaign_id, sobol_index),
    constraint an_audit_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint audit_state_is_known check (state in ('waiting', 'leased', 'agrees', 'differs')),
    constraint audit_leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null))
);

create index audit_that_is_open on audit (state, campaign_id, sobol_index)
    where state in ('waiting', 'leased');

-- Why a result is not to be trusted; null where nothing speaks against it.
alter table result add column flagged text collate "C";

-- One row a case and speed: what went in, and what came out.
create or replace view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a campaign: how far it is.
create view campaign_status as
select
    campaign.id as campaign_id,
    campaign.name,
    campaign.state,
    campaign.priority,
    cast(coalesce(sum(case_count.cases), 0) as bigint) as cases,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'waiting'), 0) as bigint) as waiting,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'leased'), 0) as bigint) as leased,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'finished'), 0) as bigint) as finished,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'failed'), 0) as bigint) as failed,
    campaign.created_at
from campaign
left join case_count on case_count.campaign_id = campaign.id
group by campaign.id;

-- Cases that were given up, what they were, and why.
create view failed_case as
select
    campaign_id,
    sobol_index,
    railpad_stiffness_N_m,
    railpad_damping_N_s_m,
    ballast_stiffness_N_m,
    ballast_damping_N_s_m,
    sleeper_EI_N_m2,
    irregularity_level,
    surface_seed,
    attempts,
    worker,
    error
from campaign_case
where state = 'failed';
