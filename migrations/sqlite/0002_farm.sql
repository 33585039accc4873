-- What a farm of several campaigns, coordinators and workers needs beside the cases themselves.

alter table campaign add column state text not null default 'running'
    constraint campaign_state_is_known check (state in ('running', 'paused', 'cancelled'));

-- The larger goes first.
alter table campaign add column priority integer not null default 0;

-- When the present lease, or the last one, began; by the coordinator's clock.
alter table campaign_case add column leased_unix_ms integer;

-- How many cases stand where, kept by triggers: a million cases are counted at once. The sum over
-- writers counts; with SQLite there is one writer, 0.
create table case_count (
    campaign_id text not null references campaign (id),
    state text not null,
    writer integer not null,
    cases integer not null,
    constraint a_writer_counts_once primary key (campaign_id, state, writer)
) strict, without rowid;

insert into case_count (campaign_id, state, writer, cases)
select campaign_id, state, 0, count(*) from campaign_case group by campaign_id, state;

create trigger count_inserted_case after insert on campaign_case begin
    insert into case_count (campaign_id, state, writer, cases)
    values (new.campaign_id, new.state, 0, 1)
    on conflict (campaign_id, state, writer) do update set cases = cases + 1;
end;

create trigger count_updated_case after update of state on campaign_case
when old.state <> new.state begin
    update case_count set cases = cases - 1
    where campaign_id = old.campaign_id and state = old.state and writer = 0;
    insert into case_count (campaign_id, state, writer, cases)
    values (new.campaign_id, new.state, 0, 1)
    on conflict (campaign_id, state, writer) do update set cases = cases + 1;
end;

create trigger count_deleted_case after delete on campaign_case begin
    update case_count set cases = cases - 1
    where campaign_id = old.campaign_id and state = old.state and writer = 0;
end;

-- Leases that ended without a result: who had them, and how they ended. Those that brought one stand
-- in result.
create table attempt (
    campaign_id text not null,
    sobol_index integer not null,
    epoch integer not null,
    worker text not null,
    leased_unix_ms integer,
    ended_unix_ms integer not null,
    ending text not null,
    error text,
    constraint a_lease_ends_once primary key (campaign_id, sobol_index, epoch),
    constraint an_attempt_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    -- failed: could not be simulated; lost: the lease expired; returned: handed back;
    -- cancelled: with its campaign; abandoned: found held when a lone coordinator started;
    -- overtaken: an earlier lease's result came after all.
    constraint ending_is_known check (
        ending in ('failed', 'lost', 'returned', 'cancelled', 'abandoned', 'overtaken'))
) strict, without rowid;

create table worker (
    id text not null primary key,
    code_version text not null,
    model_hash text not null,
    cores integer not null,
    state text not null default 'active',
    -- Why it is in quarantine.
    reason text,
    registered_unix_ms integer not null,
    last_seen_unix_ms integer not null,
    cases_finished integer not null default 0,
    cases_failed integer not null default 0,
    failures_in_a_row integer not null default 0,
    -- Computing time of the finished cases.
    busy_s real not null default 0,
    constraint worker_state_is_known check (state in ('active', 'quarantined')),
    constraint quarantined_for_a_reason check (state = 'active' or reason is not null)
) strict, without rowid;

-- What was done in each ten seconds: rates, and the history of a campaign.
create table progress (
    campaign_id text not null references campaign (id),
    from_unix_s integer not null,
    writer integer not null,
    finished integer not null,
    failed integer not null,
    busy_s real not null,
    constraint a_writer_tells_once primary key (campaign_id, from_unix_s, writer)
) strict, without rowid;

-- Finished cases that another worker is to simulate again, and what came of it.
create table audit (
    campaign_id text not null,
    sobol_index integer not null,
    -- Whose result is looked at.
    worker text not null,
    state text not null default 'waiting',
    auditor text,
    lease_expires_unix_ms integer,
    -- Largest difference of a band level between the two.
    difference_dB real,
    ended_unix_ms integer,
    constraint a_case_is_audited_once primary key (campaign_id, sobol_index),
    constraint an_audit_belongs_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint audit_state_is_known check (state in ('waiting', 'leased', 'agrees', 'differs')),
    constraint audit_leased_iff_lease_expires check (
        (state = 'leased') = (lease_expires_unix_ms is not null))
) strict, without rowid;

create index audit_that_is_open on audit (state, campaign_id, sobol_index)
    where state in ('waiting', 'leased');

-- Why a result is not to be trusted; null where nothing speaks against it.
alter table result add column flagged text;

drop view result_with_parameters;

-- One row a case and speed: what went in, and what came out.
create view result_with_parameters as
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
    coalesce(sum(case_count.cases), 0) as cases,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'waiting'), 0) as waiting,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'leased'), 0) as leased,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'finished'), 0) as finished,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'failed'), 0) as failed,
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
