/* The state of the FMU as a whole: saved, restored, as bytes. */

static Status save(const Instance *m, const char *call, void **state) {
    if (!allowed(m, call, ANY_MODE) || !given(m, call, state)) return ERROR;
    Saved *saved = *state ? *state : calloc(1, sizeof(Saved));
    if (!saved) return refuse(m, ERROR, "%s: there is no memory left", call);
    memcpy(saved->token, MODEL_TOKEN, sizeof saved->token);
    memcpy(&saved->memory, &m->now, sizeof(Memory));
    *state = saved;
    return OK;
}

static Status restore(Instance *m, const char *call, const void *state) {
    if (!allowed(m, call, ANY_MODE) || !given(m, call, state)) return ERROR;
    const Saved *saved = state;
    if (memcmp(saved->token, MODEL_TOKEN, sizeof saved->token) != 0)
        return refuse(m, ERROR, "%s: the saved state is not one of this FMU", call);
    if (saved->memory.kind != m->now.kind)
        return refuse(m, ERROR, "%s: a state of co-simulation does not fit model exchange, nor the reverse", call);
    memcpy(&m->now, &saved->memory, sizeof(Memory));
    m->any_time = true;
    forget_results(m);
    return OK;
}

static Status forget(const Instance *m, const char *call, void **state) {
    if (!allowed(m, call, ANY_MODE)) return ERROR;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return OK;
}

static Status saved_size(const Instance *m, const char *call, const void *state, size_t *size) {
    if (!allowed(m, call, ANY_MODE) || !given(m, call, state) || !given(m, call, size)) return ERROR;
    *size = sizeof(Saved);
    return OK;
}

static Status to_bytes(const Instance *m, const char *call, const void *state, void *bytes, size_t size) {
    if (!allowed(m, call, ANY_MODE) || !given(m, call, state) || !given(m, call, bytes)) return ERROR;
    if (size < sizeof(Saved))
        return refuse(m, ERROR, "%s: %lu bytes are not enough for a state", call, (unsigned long)size);
    memcpy(bytes, state, sizeof(Saved));
    return OK;
}

static bool plausible(const Memory *memory) {
    int mode = memory->mode, modes = ANY_MODE;
    modes &= memory->kind == CO_SIMULATION ? ~(EVENT | CONTINUOUS) : ~STEP;
    if (memory->kind != CO_SIMULATION && memory->kind != MODEL_EXCHANGE) return false;
    if ((mode & modes) == 0 || (mode & (mode - 1)) != 0 || !isfinite(memory->time)) return false;
    for (int i = 0; i < N_SET; i++)
        if (!isfinite(memory->values[i])) return false;
    for (int i = 0; i < N_INPUTS; i++)
        if (!isfinite(memory->rates[i])) return false;
    return true;
}

static Status from_bytes(const Instance *m, const char *call, const void *bytes, size_t size, void **state) {
    Saved read;
    if (!allowed(m, call, ANY_MODE) || !given(m, call, bytes) || !given(m, call, state)) return ERROR;
    if (size >= sizeof read) memcpy(&read, bytes, sizeof read);
    if (size < sizeof read || memcmp(read.token, MODEL_TOKEN, sizeof read.token) != 0 || !plausible(&read.memory))
        return refuse(m, ERROR, "%s: the saved state is not one of this FMU", call);
    Saved *saved = *state ? *state : calloc(1, sizeof(Saved));
    if (!saved) return refuse(m, ERROR, "%s: there is no memory left", call);
    memcpy(saved, &read, sizeof read);
    *state = saved;
    return OK;
}
